"""One line that is written over in a terminal; elsewhere a line for each change of what it says."""

import os
import shutil
from typing import TextIO

LONGEST = 118


class StatusLine:
    """Never longer than the terminal is wide: what wraps is not written over."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._moves = out.isatty()
        self._said = ""

    @property
    def is_terminal(self) -> bool:
        """Whether somebody looks on."""
        return self._moves

    def update(self, text: str, gist: str) -> None:
        """Show a text now; outside a terminal only where its gist is another than before."""
        if self._moves:
            self._out.write(f"\r\x1b[K{text[: min(LONGEST, self._columns() - 1)]}")
            self._out.flush()
        elif gist != self._said:
            self._said = gist
            self.commit(text)

    def commit(self, text: str) -> None:
        """A line that is kept."""
        self._out.write(f"\r\x1b[K{text}\n" if self._moves else f"{text}\n")
        self._out.flush()

    def _columns(self) -> int:
        """Of the terminal that is written to, now: somebody may have made it narrower."""
        try:
            return os.get_terminal_size(self._out.fileno()).columns or LONGEST + 1
        except OSError:  # no terminal that could be asked
            return shutil.get_terminal_size((LONGEST + 1, 24)).columns
