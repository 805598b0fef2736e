"""Sample blocks as readings for a procedure, and the last seconds of them."""

from collections import deque

import numpy as np

from devices.block import SampleBlock
from gateway.calibration.poses.pose import RawReadings


class RecentSamples:
    """Turns blocks into readings on one time axis and remembers the newest."""

    def __init__(self, memory_s: float) -> None:
        self._memory_s = memory_s
        self._origin_ns: int | None = None
        self._recent: deque[RawReadings] = deque()

    def take(self, block: SampleBlock) -> RawReadings:
        """Readings of a block, in the sensor's axes; seconds count from the first block."""
        if self._origin_ns is None:
            self._origin_ns = int(block.time_ns[0])
        time_s = np.asarray((block.time_ns - self._origin_ns) * 1e-9, dtype=np.float64)
        readings = RawReadings(time_s, block.raw.astype(np.float64), block.temperature_c)
        self._recent.append(readings)
        while readings.time_s[-1] - self._recent[0].time_s[0] > self._memory_s and len(self._recent) > 1:
            self._recent.popleft()
        return readings

    def recent(self) -> RawReadings:
        """The last seconds in one piece. Raises `ValueError` where there are none."""
        if not self._recent:
            raise ValueError("there are no readings yet")
        known_c = [part.temperature_c for part in self._recent if part.temperature_c is not None]
        return RawReadings(
            np.concatenate([part.time_s for part in self._recent]),
            np.concatenate([part.raw for part in self._recent]),
            float(np.mean(known_c)) if known_c else None,
        )

    def forget(self) -> None:
        """What came is of another part, or of before a gap."""
        self._recent.clear()
        self._origin_ns = None
