"""A clock for tests: time passes in sleep alone, so that minutes of samples are made at once."""

from devices.host_clock import HostClock

START_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""


class SleeplessClock(HostClock):
    """Gateway time that passes only in sleep, and as fast as it is slept."""

    def __init__(self, start_ns: int = START_NS) -> None:
        self.ns = start_ns
        self.slept_s: list[float] = []

    def now_ns(self) -> int:
        return self.ns

    def sleep_s(self, seconds: float) -> None:
        self.slept_s.append(seconds)
        self.ns += max(0, round(seconds * 1e9))
