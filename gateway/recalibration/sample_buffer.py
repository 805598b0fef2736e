"""The sample buffer: sample blocks as readings on one time axis, and the readings of the last seconds."""

from collections import deque

import numpy as np

from devices.block import SampleBlock
from gateway.calibration.poses.pose import RawReadings


class RecentSamples:
    """Converts sample blocks to readings and keeps the newest of them."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._origin_ns: int | None = None
        self._recent: deque[RawReadings] = deque()

    def add(self, block: SampleBlock) -> RawReadings:
        """Return the readings of a block, in the sensor's axes, with times from the first block, s."""
        if self._origin_ns is None:
            self._origin_ns = int(block.time_ns[0])
        time_s = np.asarray((block.time_ns - self._origin_ns) * 1e-9, dtype=np.float64)
        readings = RawReadings(time_s, block.raw.astype(np.float64), block.temperature_c)
        self._recent.append(readings)
        while readings.time_s[-1] - self._recent[0].time_s[0] > self._duration_s and len(self._recent) > 1:
            self._recent.popleft()
        return readings

    def recent(self) -> RawReadings:
        """Return the readings of the last seconds. Raises `ValueError` if there are none."""
        if not self._recent:
            raise ValueError("there are no readings yet")
        known_c = [part.temperature_c for part in self._recent if part.temperature_c is not None]
        return RawReadings(
            np.concatenate([part.time_s for part in self._recent]),
            np.concatenate([part.raw for part in self._recent]),
            float(np.mean(known_c)) if known_c else None,
        )

    def clear(self) -> None:
        """Forget the readings of another sensor, or from before a gap."""
        self._recent.clear()
        self._origin_ns = None
