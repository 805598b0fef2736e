"""The extremes of the low-passed force in the newest part of a live stream, for the published formulas, in bounded memory."""

from collections import deque

from gateway.numerics.array import Array
from gateway.swing.formulas import Extremes, extremes


class RecentExtremes:
    """Keeps the extremes of each block of the last `duration_s`."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._blocks: deque[tuple[float, Extremes]] = deque()
        """Time of the last sample and extremes of each block, oldest first."""

    def update(self, time_s: Array, lowpassed_g: Array) -> None:
        """Take a block, shapes (n,) and (n, 3)."""
        found = extremes(lowpassed_g)
        if found is None:
            return
        end_s = float(time_s[-1])
        self._blocks.append((end_s, found))
        while self._blocks[0][0] < end_s - self._duration_s:
            self._blocks.popleft()

    def since(self, from_s: float) -> Extremes | None:
        """Return the extremes of all blocks that end after a time; None without one."""
        joined: Extremes | None = None
        for end_s, found in reversed(self._blocks):
            if end_s <= from_s:
                break
            joined = found if joined is None else joined.joined(found)
        return joined
