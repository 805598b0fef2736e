"""What a terminal can do: colours where there are some (https://no-color.org), and a status line overwritten in place."""

import os
import shutil
import sys
from typing import Literal, TextIO

from gateway.text import printable

Style = Literal["good", "note", "warning", "bad"]
CODES: dict[Style, str] = {"good": "32", "note": "36", "warning": "33", "bad": "1;31"}
MAX_LINE_CHARACTERS = 118
"""Characters of a line. Basis: a choice; a terminal of 120 columns less the ends."""


def has_colours(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with colours, and its user wants them."""
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM", "dumb") != "dumb"


def paint(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return a text in the colour of a style; as it is where the stream (standard output) has none."""
    return f"\x1b[{CODES[style]}m{text}\x1b[0m" if has_colours(stream or sys.stdout) else text


class StatusLine:
    """One line of text, never longer than the terminal, because a wrapped line cannot be overwritten."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._key = ""
        self.is_terminal = out.isatty()

    def update(self, text: str, key: str) -> None:
        """Show a text now; outside a terminal only if its key differs from that of the last text."""
        text = printable(text)
        if self.is_terminal:
            self._out.write(f"\r\x1b[K{text[: min(MAX_LINE_CHARACTERS, self._columns() - 1)]}")
            self._out.flush()
        elif key != self._key:
            self._key = key
            self.commit(text)

    def commit(self, text: str) -> None:
        """Write a line that is not overwritten."""
        text = printable(text)
        self._out.write(f"\r\x1b[K{text}\n" if self.is_terminal else f"{text}\n")
        self._out.flush()

    def _columns(self) -> int:
        """Return the present width of the terminal."""
        try:
            return os.get_terminal_size(self._out.fileno()).columns or MAX_LINE_CHARACTERS + 1
        except OSError:  # not a terminal
            return shutil.get_terminal_size((MAX_LINE_CHARACTERS + 1, 24)).columns
