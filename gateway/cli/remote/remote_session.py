"""The verbs of `plumbline remote` that change something: done once, even if the link is lost in between."""

import argparse
import sys
import uuid
from typing import TYPE_CHECKING, Any

from gateway.calibration.record import PoseMethod
from gateway.cli.command import AddTo, Command, command, option
from gateway.cli.options.bus_link import MAX_ANSWER_WAIT_S, add_address, gateway_client
from gateway.errors import ANSWER_IS_NO

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient, RpcReply


REQUEST = (
    option("--by", metavar="NAME", help="your name, for the record, its history and the audit; required"),
    option("--reason", default="", metavar="TEXT", help="reason; required where a record is implausible"),
    option("--id", metavar="ID", help="id of a request whose answer was lost, so that it is not done twice"),
)


@command(
    "recalibrate",
    "start a recalibration and follow it until its record is in review",
    None,
    "example: plumbline remote recalibrate --by ann --housing-off-rope",
    *REQUEST,
    option(
        "--method",
        choices=[method.value for method in PoseMethod],
        default=PoseMethod.SIX_POSITION.value,
        help="method of the calibration (default %(default)s)",
    ),
    option("--housing-off-rope", action="store_true", help="confirm that the housing has been taken off the rope"),
    option("--follow", action="store_true", help="start nothing; follow the session that is under way"),
    add_address,
)
def run_recalibrate(arguments: argparse.Namespace) -> int:
    """Start a session and follow it, or follow the one that is under way."""
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


def _request(verb: str, description: str, example: str, field: str | None = None, *options: AddTo) -> Command:
    """Return a verb that sends the field of its request, which is its argument of this name."""

    def run(arguments: argparse.Namespace) -> int:
        _require_name(arguments)
        more = {} if field is None else {field: getattr(arguments, field)}
        with gateway_client(arguments) as client:
            return _send(client, verb, arguments, more)[0]

    return Command(
        name=verb,
        help=description[0].lower() + description.partition(".")[0][1:],
        description=description,
        epilog=f"example: plumbline remote {verb} {example}",
        options=[*REQUEST, *options, add_address],
        run=run,
    )


zero = _request("zero", "Set the two angles of the mount to zero. The load must hang still.", "--by ann")
commit = _request(
    "commit",
    "Put the record in review in force.",
    '--by ann --reason "new sensor"',
    "record",
    option("--record", metavar="ID", help="id of the record (default: the one in review)"),
)
rollback = _request(
    "rollback",
    "Put an earlier record in force again.",
    "--by ann",
    "to",
    option("--to", metavar="ID", help="id of the record (default: the parent of the present one)"),
)
mark = _request(
    "mark",
    "Write a mark into the recording. The quota deletes the time around it last.",
    '"sling slipped" --by ann',
    "text",
    option("text", metavar="TEXT", help="one line"),
)
acknowledge = _request(
    "acknowledge",
    "Acknowledge an alert: who knows of it, recorded and sent to everybody. It ends no alert.",
    "--by ann",
    "incident",
    option(
        "incident",
        nargs="?",
        metavar="INCIDENT",
        help="id of the incident (default: all that nobody has acknowledged)",
    ),
)
cancel = _request("cancel", "End the session; the old record stays in force.", "--by ann")


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
