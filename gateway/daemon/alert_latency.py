"""The time from the sample that changed an alert until that change was sent, over the last hour."""

from collections import deque

WINDOW_NS = 3600 * 10**9
MOST_CHANGES = 2048


class AlertLatency:
    """Latencies of the last hour, at most `MOST_CHANGES`."""

    def __init__(self) -> None:
        self._latencies: deque[tuple[int, float]] = deque(maxlen=MOST_CHANGES)
        """(gateway time, latency in ms)"""

    def add(self, sample_ns: int, sent_ns: int) -> None:
        """Note a change, by the gateway times of its sample and of its sending."""
        self._latencies.append((sent_ns, (sent_ns - sample_ns) / 1e6))

    def summary_ms(self, now_ns: int) -> dict[str, float] | None:
        """Return count, median, 99th percentile and maximum; None without a change in the last hour."""
        latencies_ms = sorted(ms for sent_ns, ms in tuple(self._latencies) if now_ns - sent_ns <= WINDOW_NS)
        if not latencies_ms:
            return None
        count = len(latencies_ms)
        return {
            "count": count,
            "p50": round(latencies_ms[(count - 1) // 2], 3),
            "p99": round(latencies_ms[-(-99 * count // 100) - 1], 3),
            "max": round(latencies_ms[-1], 3),
        }
