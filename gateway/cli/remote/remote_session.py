"""The verbs of `plumbline remote` that change something: done once, even if the link is lost in between.

A recalibration is followed until its review or its end: with a bar in a terminal, with a line for each change elsewhere.
"""

import argparse
import sys
import time
import uuid
from typing import TYPE_CHECKING, Any, TextIO

from gateway.calibration.record import PoseMethod
from gateway.cli.bus_link import ADDRESS_OPTIONS, MAX_ANSWER_WAIT_S, gateway_client
from gateway.cli.command import AddTo, Command, command, option
from gateway.cli.output import StatusLine
from gateway.errors import ANSWER_IS_NO

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient, RpcReply
    from gateway.daemon.runtime.worker import BoundedQueue

REQUEST_OPTIONS = (
    option("--by", metavar="NAME", help="your name, for the record, its history and the audit; required"),
    option("--reason", default="", metavar="TEXT", help="reason; required where a record is implausible"),
    option("--id", metavar="ID", help="id of a request whose answer was lost, so that it is not done twice"),
)
MAX_STALE_ANSWERS = 4
"""A gateway that has just accepted a session may still report the time before, at most this often. Basis: two seconds of
sessions."""
SESSION_SILENCE_S = 1.5
"""A gateway that collects poses reports its session twice per second; after this silence it is queried. Basis: three messages of
the session."""
MAX_QUEUED_MESSAGES = 256
"""Messages that may wait. Basis: a choice; minutes of a session, and a bound of the memory."""
HOLD_BAR_CHARACTERS = 24
"""Width of the bar, characters. Basis: a choice; a third of a line."""
NO_ANSWER = "no answer from the gateway; waiting for it"
CONTINUES = "the session continues: plumbline remote recalibrate --follow shows it, plumbline remote cancel ends it"


@command(
    "recalibrate",
    "start a recalibration and follow it until its record is in review",
    None,
    "example: plumbline remote recalibrate --by ann --housing-off-rope",
    *REQUEST_OPTIONS,
    option(
        "--method",
        choices=[method.value for method in PoseMethod],
        default=PoseMethod.SIX_POSITION.value,
        help="method of the calibration (default %(default)s)",
    ),
    option("--housing-off-rope", action="store_true", help="confirm that the housing has been taken off the rope"),
    option("--follow", action="store_true", help="start nothing; follow the session that is under way"),
    *ADDRESS_OPTIONS,
)
def run_recalibrate(arguments: argparse.Namespace) -> int:
    """Start a session and follow it, or follow the one that is under way."""
    from gateway.cli.remote.remote_session import watch_session

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
        options=[*REQUEST_OPTIONS, *options, *ADDRESS_OPTIONS],
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


def watch_session(client: "GatewayClient", session_id: str | None, out: TextIO) -> int:
    """Show a session until it is in review or has ended; return 0 if its record may be or has been committed, else 1."""
    display = SessionDisplay(out)
    messages = _subscribe(client)
    session = _query(client)
    stale = 0 if session_id is None else MAX_STALE_ANSWERS
    try:
        while True:
            if session is not None:
                session_id = session_id or session["id"]
                if session["id"] == session_id and session["phase"] != "idle":
                    stale = 0
                    display.show(session)
                    if session["phase"] != "collecting":
                        return _show_result(session, display)
                elif stale == 0:
                    display.add_line("no such session is under way")
                    return 1
                else:
                    stale -= 1
            session = _wait_for_session(client, messages, display)
    except KeyboardInterrupt:
        display.add_line(CONTINUES)
        raise


def _subscribe(client: "GatewayClient") -> "BoundedQueue[dict[str, Any]]":
    from gateway.daemon.runtime.worker import BoundedQueue

    messages: BoundedQueue[dict[str, Any]] = BoundedQueue(MAX_QUEUED_MESSAGES)
    client.subscribe("calibration", messages.put)
    return messages


def _wait_for_session(
    client: "GatewayClient", messages: "BoundedQueue[dict[str, Any]]", display: "SessionDisplay"
) -> dict[str, Any] | None:
    """Return the next state of the session; None if nobody answers, after an attempt to reconnect."""
    message = messages.get(SESSION_SILENCE_S)
    if message is not None:
        return _session(message)
    session = _query(client)
    if session is None:
        display.show_waiting()
        if client.reconnect():
            client.subscribe("calibration", messages.put)
        else:
            time.sleep(SESSION_SILENCE_S)
    return session


def _query(client: "GatewayClient") -> dict[str, Any] | None:
    status = client.status()
    return None if status is None or "calibration" not in status else _session(status["calibration"])


def _session(message: dict[str, Any]) -> dict[str, Any]:
    session: dict[str, Any] = message["session"]
    return session


def _show_result(session: dict[str, Any], display: "SessionDisplay") -> int:
    if session["phase"] == "review":
        for reason in [*session["notes"], *session["reasons"]]:
            display.add_line(f"  {reason}")
        display.add_line(
            f"record {session['record_id']} is in review: plumbline remote commit, or plumbline remote cancel"
        )
        return 0 if session.get("committable", False) else 1
    return 0 if session["phase"] == "committed" else 1


class SessionDisplay:
    """Shows a bar in a terminal, and elsewhere a line for each change of the text."""

    def __init__(self, out: TextIO) -> None:
        self._line = StatusLine(out)

    def show(self, session: dict[str, Any]) -> None:
        """Show the state of the session."""
        taken, wanted = _count_poses(session), max(session["wanted"], 1)
        if session["phase"] != "collecting":
            self.add_line(f"{session['phase']}: {session['text']}")
            return
        text = f"{taken} of {wanted} poses; {session['text']}"
        if self._line.is_terminal:
            fraction = min((taken + session["pose_fraction"]) / wanted, 1.0)
            bar = ("#" * round(fraction * HOLD_BAR_CHARACTERS)).ljust(HOLD_BAR_CHARACTERS, "-")
            progress = f"{taken}/{wanted} [{bar}] {_stillness(session):14} {_next_face(session)}{session['text']}"
            self._line.update(progress, text)
        else:
            self._line.update(text, text)

    def show_waiting(self) -> None:
        """Show that the gateway does not answer."""
        self._line.update(NO_ANSWER, NO_ANSWER)

    def add_line(self, text: str) -> None:
        """Write a line that is not overwritten."""
        self._line.commit(text)


def _count_poses(session: dict[str, Any]) -> int:
    """Return the number of different poses: of the six faces, or of all attitudes."""
    used = [pose for pose in session["poses"] if pose["used"]]
    return len({pose["face"] for pose in used}) if session["method"] == PoseMethod.SIX_POSITION else len(used)


def _next_face(session: dict[str, Any]) -> str:
    """Return the next face, which stands before the text because a narrow terminal truncates that."""
    return f"next {session['next_face']} up; " if session["next_face"] else ""


def _stillness(session: dict[str, Any]) -> str:
    if not session["still"]:
        return "moving"
    left_s = session["seconds_left"]
    return "still" if left_s is None else f"still {left_s:.0f} s left"
