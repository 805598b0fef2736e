"""The progress of a long command, on stderr if that is a terminal."""

import sys
from types import TracebackType
from typing import TextIO

from gateway.cli.interrupt import DeferredInterrupt

WIDTH = 40


class Progress:
    """A line that is drawn again at each tick; nothing if stderr is not a terminal. Ctrl-C takes effect between ticks."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = self._stream.isatty()
        self._ticks = 0
        self._interrupt = DeferredInterrupt()

    def tick(self, stage: str) -> None:
        """Show one more step of a stage."""
        self._interrupt.check()
        self._ticks += 1
        if self._shown:
            done = self._ticks % WIDTH
            self._stream.write(f"\r[{'·' * done}{' ' * (WIDTH - done)}] {stage}, step {self._ticks} ")
            self._stream.flush()

    def __enter__(self) -> "Progress":
        self._interrupt.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown and self._ticks:
            self._stream.write("\r" + " " * (WIDTH + 40) + "\r")
            self._stream.flush()
        self._interrupt.__exit__(kind, error, trace)
