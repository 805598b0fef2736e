"""`plumbline fleet status --watch`: the list, redrawn in a terminal; elsewhere a line for each change of a state."""

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from gateway.fleet.report import FleetReport

HOME_AND_CLEAR = "\x1b[H\x1b[J"
OTHER_SCREEN, USUAL_SCREEN = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
"""The list is drawn on the terminal's second screen without a cursor, and leaves the first one as it was."""

USUAL_COLUMNS, USUAL_ROWS = 120, 24
"""Size of a terminal that does not state one, such as a serial console. Basis: a choice; 24 rows of a VT100, and columns for the
table."""


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
        from gateway.documents.text import printable_text

        self._out.write(f"{report.time_utc:%Y-%m-%dT%H:%M:%SZ}  {printable_text(text, 400)}\n")
        self._out.flush()

    def close(self) -> None:
        pass
