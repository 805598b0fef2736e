"""Time that passes only in sleep."""

START_NS = 1_760_000_000_123_456_789


class FakeClock:
    """Time that passes only in sleep."""

    def __init__(self) -> None:
        self.ns = START_NS

    def now_ns(self) -> int:
        return self.ns

    def sleep_s(self, seconds: float) -> None:
        self.ns += max(0, round(seconds * 1e9))
