"""A status line: overwritten in place in a terminal; elsewhere a new line for each change."""

import os
import shutil
from typing import TextIO

from gateway.text import printable

LONGEST = 118


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
            self._out.write(f"\r\x1b[K{text[: min(LONGEST, self._columns() - 1)]}")
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
            return os.get_terminal_size(self._out.fileno()).columns or LONGEST + 1
        except OSError:  # not a terminal
            return shutil.get_terminal_size((LONGEST + 1, 24)).columns
