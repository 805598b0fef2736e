"""A line on stderr that tells how a long command goes on, where a person looks."""

import sys
from types import TracebackType
from typing import TextIO

from gateway.cli.interrupt import DeferredInterrupt

WIDTH = 40


class Progress:
    """Redrawn at each tick; nothing at all where stderr is no terminal. Ctrl-C is taken between ticks."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = self._stream.isatty()
        self._ticks = 0
        self._interrupt = DeferredInterrupt()

    def tick(self, stage: str) -> None:
        """One more step of a stage."""
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
