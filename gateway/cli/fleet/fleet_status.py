"""`plumbline fleet status`: the state of all gateways on a router.

With `--watch`, the list is redrawn in a terminal; elsewhere each change of a state is a line.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TextIO

from gateway.cli.argument_types import above_zero, parsed_by, whole_number
from gateway.cli.bus_link import CONNECT_OPTIONS, EXPECT_OPTION, expected_gateways, fleet_client
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION

if TYPE_CHECKING:
    from gateway.bus.fleet_client import FleetClient
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.gateway_status import FleetWord
    from gateway.fleet.report import FleetQuery, FleetReport
    from gateway.messages import Level


SORT_NAMES = ("state", "name", "swing", "battery", "signal", "calibration", "seen", "software")
FLEET_POLL_S = 0.1
"""Time between two looks. Basis: a choice; not visible to a person, and it costs little."""
LIVELINESS_S = 0.5
"""Shortest wait for the liveliness tokens of all gateways. Basis: a choice; tokens come within round trips, and a person does not
wait longer."""
HOME_AND_CLEAR = "\x1b[H\x1b[J"
OTHER_SCREEN, USUAL_SCREEN = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
"""The list is drawn on the terminal's second screen without a cursor, and leaves the first one as it was."""
USUAL_COLUMNS, USUAL_ROWS = 120, 24
"""Size of a terminal that does not state one, such as a serial console. Basis: a choice; 24 rows of a VT100, and columns for the
table."""


def _parse_states(text: str) -> "frozenset[FleetWord]":
    from gateway.fleet.selection import parse_states

    return parse_states(text)


def _parse_levels(text: str) -> "frozenset[Level]":
    from gateway.fleet.selection import parse_levels

    return parse_levels(text)


@command(
    "status",
    "list all gateways on a router with their state, and what is wrong",
    "List all gateways on a router with state, alert level, swing, battery, signal, age of the calibration and "
    "software. Exit code 0: all are OK; 1: one is not, or an expected one is missing; 2: wrong usage.",
    "examples: plumbline fleet status --expect gateways.txt | plumbline fleet status --site 'yard-*' --sort swing "
    "--watch | plumbline fleet status --accept disturbed --json -",
    *(
        option(
            f"--{part}",
            default="*",
            metavar="PATTERN",
            help=f"judge only gateways of this {part}; * ? [abc] match other characters",
        )
        for part in ("site", "crane", "sensor")
    ),
    option(
        "--state",
        type=parsed_by(_parse_states),
        default=frozenset(),
        metavar="LIST",
        help="list only these states, such as limit,stale",
    ),
    option(
        "--level",
        type=parsed_by(_parse_levels),
        default=frozenset(),
        metavar="LIST",
        help="list only these alert levels: normal, warn, trip, unknown",
    ),
    option(
        "--sort", choices=SORT_NAMES, default="state", help="order of the list (default: the most urgent state first)"
    ),
    option(
        "--accept",
        type=parsed_by(_parse_states),
        default=frozenset(),
        metavar="LIST",
        help="states beside ok that are no fault, such as disturbed, which occurs while cranes work",
    ),
    EXPECT_OPTION,
    JSON_OPTION,
    option(
        "--wait-s",
        type=above_zero,
        default=5.0,
        metavar="S",
        help="longest wait for messages of gateways that are alive (default %(default)g)",
    ),
    option(
        "--watch",
        action="store_true",
        help="go on until Ctrl-C: in a terminal the list is redrawn, elsewhere a change is a line",
    ),
    option("--interval-s", type=above_zero, default=1.0, metavar="S", help="interval of --watch (default %(default)g)"),
    option("--count", type=whole_number, metavar="N", help="end --watch after N intervals"),
    *CONNECT_OPTIONS,
)
def run_status(arguments: argparse.Namespace) -> int:
    """Print the list, or go on; return 1 where a gateway is not well."""
    from gateway.cli.output import show
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.report import FleetQuery
    from gateway.fleet.selection import ListFilter, NamePatterns

    names = NamePatterns(arguments.site, arguments.crane, arguments.sensor)
    query = FleetQuery(names, ListFilter(arguments.state, arguments.level), arguments.sort, arguments.accept)
    state = FleetState(frozenset(filter(names.matches, expected_gateways(arguments))))
    with fleet_client(arguments, names.key_pattern) as client:
        fleet = LiveFleet(client, state, query)
        fleet.wait(arguments.wait_s)
        if arguments.watch:
            return watch_fleet(fleet.report, sys.stdout, arguments.interval_s, arguments.count)
        report = fleet.report()
    show("\n".join(report.lines()), report.as_json(), arguments.json)
    return 0 if report.well else 1


class LiveFleet:
    """The state of a fleet that follows its client."""

    def __init__(self, client: "FleetClient", state: "FleetState", query: "FleetQuery") -> None:
        self._client = client
        self._state = state
        self._query = query
        client.request_latest()

    def wait(self, longest_s: float) -> None:
        """Receive until every gateway that is alive has sent its state, or the time is over."""
        begun_s = time.monotonic()
        while (passed_s := time.monotonic() - begun_s) < longest_s:
            time.sleep(FLEET_POLL_S)
            self._state.receive(self._client.receive())
            if passed_s >= LIVELINESS_S and self._state.complete:
                return

    def report(self) -> "FleetReport":
        """Return the present report."""
        from gateway.fleet.report import make_report

        state = self._state
        state.receive(self._client.receive())
        now_utc = datetime.now(UTC)
        return make_report(
            state.statuses(time.monotonic(), now_utc),
            self._query,
            expected=state.expected,
            connected=self._client.connected,
            invalid=state.invalid + self._client.inbox.refused,
            time_utc=now_utc,
        )


def watch_fleet(look: "Callable[[], FleetReport]", out: TextIO, interval_s: float, count: int | None) -> int:
    """Show a fleet until Ctrl-C or after a number of looks; return 0 if it was well at the last one, else 1."""
    view = _TerminalDisplay(out) if out.isatty() else _ChangeLog(out)
    seen, report = 0, look()
    try:
        while True:
            view.show(report)
            seen += 1
            if count is not None and seen >= count:
                return 0 if report.well else 1
            time.sleep(interval_s)
            report = look()
    finally:
        view.close()


class _TerminalDisplay:
    def __init__(self, out: TextIO) -> None:
        self._out = out
        out.write(OTHER_SCREEN)

    def show(self, report: "FleetReport") -> None:
        size = os.get_terminal_size(self._out.fileno())
        columns, rows = size.columns or USUAL_COLUMNS, size.lines or USUAL_ROWS
        lines = [f"{report.time_utc:%H:%M:%S} UTC  {report.lines()[0]}", *report.lines()[1:]]
        if len(lines) > rows:
            lines = [
                *lines[: rows - 1],
                f"... {len(lines) - rows + 1} more lines; narrow the list with --state or --site",
            ]
        self._out.write(HOME_AND_CLEAR + "\n".join(line[:columns] for line in lines))
        self._out.flush()

    def close(self) -> None:
        self._out.write(USUAL_SCREEN)
        self._out.flush()


class _ChangeLog:
    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._labels: dict[str, str] = {}
        self._connected = True

    def show(self, report: "FleetReport") -> None:
        if not self._labels:
            self._write(report, report.lines()[0])
        if report.connected != self._connected:
            self._connected = report.connected
            self._write(report, "connected to the router" if report.connected else "no connection to the router")
        labels = {status.name: status.label for status in report.listed}
        why = {status.name: "; ".join(status.reasons) for status in report.listed}
        for name, label in labels.items():
            if self._labels.get(name) != label:
                self._write(report, f"{name}  {label}  {why[name]}".rstrip())
        self._labels |= labels

    def _write(self, report: "FleetReport", text: str) -> None:
        from gateway.documents.format import printable_text

        self._out.write(f"{report.time_utc:%Y-%m-%dT%H:%M:%SZ}  {printable_text(text, 400)}\n")
        self._out.flush()

    def close(self) -> None:
        pass
