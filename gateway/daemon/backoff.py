"""Pauses between attempts that double up to a limit."""


class Backoff:
    """The pause before the next attempt."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self.pause_s = first_s
        self._longest_s = longest_s

    def increase(self) -> None:
        """Double the pause, up to the limit."""
        self.pause_s = min(2 * self.pause_s, self._longest_s)
