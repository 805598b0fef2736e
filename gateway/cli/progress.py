"""The progress of a long command, on stderr if that is a terminal: steps of unknown number, or a share with the time left.

CasADi drops a KeyboardInterrupt that is raised inside its functions, or returns None for it: Ctrl-C is kept for it meanwhile.
"""

import signal
import sys
import time
from types import FrameType, TracebackType
from typing import TextIO

PROGRESS_BAR_CHARACTERS = 40
"""Width of the bar, characters. Basis: a choice; half of a terminal's line."""
QUIET_S = 1.0
"""Work that is done sooner shows no progress. Basis: a choice; a person begins to wonder."""
REDRAW_S = 0.2
"""Basis: a choice; the bar moves for the eye, and writing costs nothing."""
MIN_ESTIMATED_SHARE = 0.02
"""Share of the work from which the time left is told. Basis: a choice; the rate is then known to some per cent."""


class DeferredInterrupt:
    """Hold Ctrl-C back until the next `check`, or the end; a second Ctrl-C acts at once."""

    def __init__(self) -> None:
        self.presses = 0
        """How often Ctrl-C was pressed."""
        self._is_installed = False

    def __enter__(self) -> "DeferredInterrupt":
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._note)
            self._is_installed = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
        if error is None:
            self.check()

    def release(self) -> None:
        """Let Ctrl-C act at once again."""
        if self._is_installed:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def check(self) -> None:
        """Raise `KeyboardInterrupt` where Ctrl-C was pressed."""
        if self.presses:
            raise KeyboardInterrupt

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.presses += 1
        if self.presses > 1:
            signal.default_int_handler(number, frame)


class Progress:
    """A line that is drawn again at each tick; nothing if stderr is not a terminal. Ctrl-C takes effect between ticks.

    Of work with `best_so_far`, Ctrl-C asks for the best answer so far, a second one stops it.
    """

    def __init__(self, stream: TextIO | None = None, *, best_so_far: bool = False) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = self._stream.isatty()
        self._ticks = self._drawn = 0
        self._begin_s = time.monotonic()
        self._interrupt = DeferredInterrupt()
        self._best_so_far = best_so_far

    @property
    def is_interrupted(self) -> bool:
        """Whether Ctrl-C was pressed."""
        return self._interrupt.presses > 0

    def tick(self, stage: str, share: float | None = None) -> None:
        """Show one more step of a stage, and the share of its largest work that is done."""
        if not self._best_so_far or self._interrupt.presses > 1:
            self._interrupt.check()
        if self.is_interrupted:
            stage, share = "the best answer so far; Ctrl-C again stops without one", None
        self._ticks += 1
        if self._shown:
            done = self._ticks % PROGRESS_BAR_CHARACTERS if share is None else round(PROGRESS_BAR_CHARACTERS * share)
            text = f"{stage}, step {self._ticks}" if share is None else f"{stage}, {share:.0%}{self._most_left(share)}"
            line = f"[{'·' * done}{' ' * (PROGRESS_BAR_CHARACTERS - done)}] {text}"
            self._stream.write("\r" + line.ljust(self._drawn))
            self._stream.flush()
            self._drawn = len(line)

    def _most_left(self, share: float) -> str:
        """Return the longest time that the work may still take, once enough of it is done."""
        if share < MIN_ESTIMATED_SHARE:
            return ""
        left_s = (time.monotonic() - self._begin_s) * (1 - share) / share
        return f", at most {left_s / 60:.0f} min left" if left_s > 90 else f", at most {left_s:.0f} s left"

    def __enter__(self) -> "Progress":
        self._interrupt.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown and self._ticks:
            self._stream.write("\r" + " " * self._drawn + "\r")
            self._stream.flush()
        if self._best_so_far:
            self._interrupt.release()
        else:
            self._interrupt.__exit__(kind, error, trace)


class ProgressBar:
    """A bar with the share that is done and the time left; nothing if stderr is not a terminal, or the work is short."""

    def __init__(self, stage: str, stream: TextIO | None = None) -> None:
        self._stage = stage
        self._stream = sys.stderr if stream is None else stream
        self._begin_s = self._drawn_s = time.monotonic()
        self._drawn = 0
        """Length of the line that is shown."""

    def update(self, share: float) -> None:
        """Show the share of the work that is done, 0 to 1."""
        now_s = time.monotonic()
        if now_s - self._begin_s < QUIET_S or now_s - self._drawn_s < REDRAW_S or not self._stream.isatty():
            return
        self._drawn_s = now_s
        done = round(PROGRESS_BAR_CHARACTERS * share)
        left_s = (now_s - self._begin_s) * (1 - share) / share if share > 0 else None
        left = "" if left_s is None else f", {left_s / 60:.0f} min left" if left_s > 90 else f", {left_s:.0f} s left"
        line = f"[{'·' * done}{' ' * (PROGRESS_BAR_CHARACTERS - done)}] {share:4.0%}{left}  {self._stage}"
        self._stream.write("\r" + line.ljust(self._drawn))
        self._stream.flush()
        self._drawn = len(line)

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._drawn:
            self._stream.write("\r" + " " * self._drawn + "\r")
            self._stream.flush()
