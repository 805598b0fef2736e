"""A rate limit by sample time, so that a replay emits the same messages as the live run."""


class RateLimiter:
    """Allow one message per period of gateway time, on a fixed grid, for any length of the blocks."""

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * 1e9)
        self._slot: int | None = None

    def is_due(self, time_ns: int) -> bool:
        """Return whether a new period of the grid has begun since the last call."""
        slot = time_ns // self._period_ns
        if slot == self._slot:
            return False
        self._slot = slot
        return True
