"""How often: gates that open by sample time, so that a replay emits where the live run did."""


class RateLimiter:
    """Opens at most once per period of gateway time, on a grid, whatever the block length."""

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * 1e9)
        self._slot: int | None = None

    def is_due(self, time_ns: int) -> bool:
        """Whether a new slot of the grid has begun."""
        slot = time_ns // self._period_ns
        if slot == self._slot:
            return False
        self._slot = slot
        return True
