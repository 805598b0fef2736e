"""The verbs of `plumbline remote` that change something: done once, even if the link is lost in between."""

import argparse
import sys
import uuid
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway.calibration.record import PoseMethod
from gateway.cli.options.bus_link import MAX_ANSWER_WAIT_S, add_address, gateway_client
from gateway.errors import ANSWER_IS_NO

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient, RpcReply

Run = Callable[[argparse.Namespace], int]
"""What a verb does; it returns the exit code."""


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verbs."""
    recalibrate = _verb(
        verbs,
        "recalibrate",
        "Start a recalibration and follow it until its record is in review.",
        _recalibrate,
        "--by ann --housing-off-rope",
    )
    recalibrate.add_argument(
        "--method",
        choices=[method.value for method in PoseMethod],
        default=PoseMethod.SIX_POSITION.value,
        help="method of the calibration (default %(default)s)",
    )
    recalibrate.add_argument(
        "--housing-off-rope", action="store_true", help="confirm that the housing has been taken off the rope"
    )
    recalibrate.add_argument(
        "--follow", action="store_true", help="start nothing; follow the session that is under way"
    )
    _verb(verbs, "zero", "Set the two angles of the mount to zero. The load must hang still.", _request(), "--by ann")
    commit = _verb(
        verbs, "commit", "Put the record in review in force.", _request("record"), '--by ann --reason "new sensor"'
    )
    commit.add_argument("--record", metavar="ID", help="id of the record (default: the one in review)")
    rollback = _verb(verbs, "rollback", "Put an earlier record in force again.", _request("to"), "--by ann")
    rollback.add_argument("--to", metavar="ID", help="id of the record (default: the parent of the present one)")
    mark = _verb(
        verbs,
        "mark",
        "Write a mark into the recording. The quota deletes the time around it last.",
        _request("text"),
        '"sling slipped" --by ann',
    )
    mark.add_argument("text", metavar="TEXT", help="one line")
    acknowledge = _verb(
        verbs,
        "acknowledge",
        "Acknowledge an alert: who knows of it, recorded and sent to everybody. It ends no alert.",
        _request("incident"),
        "--by ann",
    )
    acknowledge.add_argument(
        "incident", nargs="?", metavar="INCIDENT", help="id of the incident (default: all that nobody has acknowledged)"
    )
    _verb(verbs, "cancel", "End the session; the old record stays in force.", _request(), "--by ann")
    for name in ("recalibrate", "zero", "commit", "rollback", "mark", "acknowledge", "cancel"):
        add_address(verbs.choices[name])


def _verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, description: str, run: Run, example: str
) -> argparse.ArgumentParser:
    summary = description[0].lower() + description.partition(".")[0][1:]
    verb = verbs.add_parser(
        name, help=summary, description=description, epilog=f"example: plumbline remote {name} {example}"
    )
    verb.add_argument("--by", metavar="NAME", help="your name, for the record, its history and the audit; required")
    verb.add_argument("--reason", default="", metavar="TEXT", help="reason; required where a record is implausible")
    verb.add_argument("--id", metavar="ID", help="id of a request whose answer was lost, so that it is not done twice")
    verb.set_defaults(run=run)
    return verb


def _recalibrate(arguments: argparse.Namespace) -> int:
    from gateway.cli.remote.follow import watch_session

    _require_name(arguments)
    with gateway_client(arguments) as client:
        session_id = None
        if not arguments.follow:
            more = {"method": arguments.method, "housing_off_rope": arguments.housing_off_rope}
            code, request = _send(client, "recalibrate", arguments, more)
            if code != 0:
                return code
            session_id = request["id"]
        return watch_session(client, session_id, sys.stdout)


def _request(*fields: str) -> Run:
    """Return what runs a verb: it sends the fields of its request, which are its arguments of these names."""

    def run(arguments: argparse.Namespace) -> int:
        _require_name(arguments)
        with gateway_client(arguments) as client:
            return _send(client, arguments.verb, arguments, {name: getattr(arguments, name) for name in fields})[0]

    return run


def new_request(arguments: argparse.Namespace, more: dict[str, Any]) -> dict[str, Any]:
    """Return a request with the person's name and reason, and an id of its own unless `--id` states one."""
    request_id = getattr(arguments, "id", None) or f"cli-{uuid.uuid4().hex}"
    return {"id": request_id, "by": arguments.by, "reason": arguments.reason, **more}


def ask(client: "GatewayClient", verb: str, request: dict[str, Any], remedy: str) -> "RpcReply":
    """Return the answer to a request. Raises `InputError` with the remedy where nobody answers."""
    from gateway.errors import InputError

    reply = client.ask(verb, request, MAX_ANSWER_WAIT_S)
    if reply is None:
        raise InputError(f"{client.key} does not answer{remedy}")
    return reply


def _send(
    client: "GatewayClient", verb: str, arguments: argparse.Namespace, more: dict[str, Any]
) -> tuple[int, dict[str, Any]]:
    """Send a request and print the answer."""
    request = new_request(arguments, more)
    again = f", and the request may have been done: repeat it with --id {request['id']}"
    reply = ask(client, verb, request, again)
    print(f"{verb}: {'' if reply.accepted else 'refused: '}{reply.text}", file=None if reply.accepted else sys.stderr)
    return 0 if reply.accepted else ANSWER_IS_NO, request


def _require_name(arguments: argparse.Namespace) -> None:
    from gateway.errors import InputError

    if not arguments.by and not getattr(arguments, "follow", False):
        raise InputError("--by NAME is required: your name, for the record, its history and the audit")
