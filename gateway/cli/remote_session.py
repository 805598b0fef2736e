"""`plumbline remote`, the verbs that change something: asked once, answered once, followed over lost links."""

import argparse
import sys
import uuid
from typing import TYPE_CHECKING, Any

from gateway.calibration.pose_method import PoseMethod

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient

REFUSED = 1
PATIENCE_S = 30.0


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> list[argparse.ArgumentParser]:
    """Add the verbs; returns their parsers."""
    recalibrate = _verb(
        verbs, "recalibrate", "begin a session and follow it", _recalibrate, "--by ann --housing-off-rope"
    )
    recalibrate.add_argument(
        "--method", choices=[method.value for method in PoseMethod], default=PoseMethod.SIX_POSITION.value
    )
    recalibrate.add_argument(
        "--housing-off-rope", action="store_true", help="confirm that the housing has been taken off the rope"
    )
    recalibrate.add_argument("--follow", action="store_true", help="ask for nothing, follow the session under way")
    _verb(verbs, "zero", "make the mount's angles zero; the load must hang still", _zero, "--by ann")
    commit = _verb(verbs, "commit", "put the reviewed record in force", _commit, '--by ann --reason "new sensor"')
    commit.add_argument("--record", metavar="ID", help="only this record; without it, the one that is in review now")
    rollback = _verb(verbs, "rollback", "put the parent record in force again", _rollback, "--by ann")
    rollback.add_argument("--to", metavar="ID", help="this record instead of the parent")
    _verb(verbs, "cancel", "end the session; the old record stays", _cancel, "--by ann")
    return [verbs.choices[name] for name in ("recalibrate", "zero", "commit", "rollback", "cancel")]


def _verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, help_text: str, run: Any, example: str
) -> argparse.ArgumentParser:
    verb = verbs.add_parser(name, help=help_text, epilog=f"example: plumbline remote {name} {example}")
    verb.add_argument("--by", metavar="NAME", help="who asks; goes into the record, its history and the audit")
    verb.add_argument("--reason", default="", metavar="TEXT", help="why; asked for where a record is implausible")
    verb.add_argument("--id", metavar="ID", help="of a request whose answer was lost: it is not done twice")
    verb.set_defaults(run=run)
    return verb


def _recalibrate(arguments: argparse.Namespace) -> int:
    from gateway.cli.follow import watch_session

    client = _client(arguments)
    try:
        session_id = None
        if not arguments.follow:
            more = {"method": arguments.method, "housing_off_rope": arguments.housing_off_rope}
            code, request = _request(client, "recalibrate", arguments, more)
            if code != 0:
                return code
            session_id = request["id"]
        return watch_session(client, session_id, sys.stdout)
    finally:
        client.close()


def _zero(arguments: argparse.Namespace) -> int:
    return _ask(arguments, "zero", {})


def _commit(arguments: argparse.Namespace) -> int:
    return _ask(arguments, "commit", {"record": arguments.record})


def _rollback(arguments: argparse.Namespace) -> int:
    return _ask(arguments, "rollback", {"to": arguments.to})


def _cancel(arguments: argparse.Namespace) -> int:
    return _ask(arguments, "cancel", {})


def _ask(arguments: argparse.Namespace, verb: str, more: dict[str, Any]) -> int:
    client = _client(arguments)
    try:
        return _request(client, verb, arguments, more)[0]
    finally:
        client.close()


def _request(
    client: "GatewayClient", verb: str, arguments: argparse.Namespace, more: dict[str, Any]
) -> tuple[int, dict[str, Any]]:
    """Ask, and print the answer."""
    from gateway.errors import InputError

    request = {"id": arguments.id or f"cli-{uuid.uuid4().hex}", "by": arguments.by, "reason": arguments.reason, **more}
    said = client.ask(verb, request, PATIENCE_S)
    if said is None:
        raise InputError(
            f"{client.key} does not answer; whether it was done is not known: ask again with --id {request['id']}"
        )
    print(f"{verb}: {'' if said.accepted else 'refused: '}{said.text}", file=None if said.accepted else sys.stderr)
    return 0 if said.accepted else REFUSED, request


def _client(arguments: argparse.Namespace) -> "GatewayClient":
    from gateway.bus.client import GatewayClient
    from gateway.errors import InputError

    if not arguments.by and not getattr(arguments, "follow", False):
        raise InputError("--by: say who asks; it goes into the record, its history and the audit")
    return GatewayClient(arguments.connect, arguments.gateway)
