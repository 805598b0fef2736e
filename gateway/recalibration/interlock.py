"""What is remembered of the load and its sensor before a recalibration: verdicts and load signal, and the newest readings.

The interlock judges what must be true of the load before its sensor is taken off the rope or zeroed; zeroing takes the readings.
"""

from collections import deque

import numpy as np

from devices.block import SampleBlock
from gateway.calibration.pose import MIN_UNBROKEN_REST_S, RawReadings
from gateway.messages import Verdict

MEMORY_S = 60.0
"""Time for which verdicts are remembered, s. Basis: longer than `MIN_STATIC_S`, which is half as much."""
MAX_VERDICTS = 600
"""Largest number of verdicts that are remembered. Basis: `MEMORY_S` has 120 at two verdicts per second; a bound of the memory at
any rate."""
MIN_STATIC_S = MIN_UNBROKEN_REST_S + 2.0
"""Least time, s, for which a load must have been static before its rope is used as a plumb line. Basis: the rest that zeroing
reads, and one window of the conditions."""
LOAD_SIGNAL_VALID_S = 10.0
"""Time for which a load counts as hanging after the load signal has last said so, s. Basis: a choice; a sender may miss some
messages, and a load is not hooked in and lifted sooner."""
STILL_VERDICTS: tuple[Verdict, ...] = ("static", "quasi_static")
MOVING_VERDICTS: tuple[Verdict, ...] = ("swinging", "driven", "disturbed")


class LoadInterlock:
    """Remembers the verdicts of the condition over the last minute, and when the load signal last reported a load.

    A signal that says "no load" takes nothing back: it proves its sender no more than any other. Times are those of the samples.
    """

    def __init__(self) -> None:
        self._verdicts: deque[tuple[int, Verdict]] = deque(maxlen=MAX_VERDICTS)
        self._loaded_ns: int | None = None

    def add_verdict(self, verdict: Verdict, time_ns: int) -> None:
        """Add a verdict of the condition stage."""
        self._verdicts.append((time_ns, verdict))
        while time_ns - self._verdicts[0][0] > MEMORY_S * 1e9:
            self._verdicts.popleft()

    def note_load(self, time_ns: int) -> None:
        """Note that the load signal reported a load."""
        self._loaded_ns = time_ns

    def clear(self) -> None:
        """Forget the verdicts, after which the load may have moved."""
        self._verdicts.clear()

    @property
    def static_s(self) -> float:
        """Time for which all verdicts have been static, up to the newest, s."""
        moved = [time_ns for time_ns, verdict in self._verdicts if verdict != "static"]
        static = [time_ns for time_ns, _ in self._verdicts if not moved or time_ns > moved[-1]]
        return (static[-1] - static[0]) / 1e9 if static else 0.0

    def recalibration_refusal(self, *, confirmed: bool, now_ns: int) -> str | None:
        """Return why the housing may not be taken off the rope, or None; `confirmed` if it has been taken off."""
        if self._loaded_ns is not None and now_ns - self._loaded_ns < LOAD_SIGNAL_VALID_S * 1e9:
            return "a load hangs on the hook, by the load signal; its swing must be monitored"
        if confirmed:
            return None
        recent = {verdict for _, verdict in self._verdicts}
        if recent & set(MOVING_VERDICTS):
            return f"the load has moved within the last {MEMORY_S:.0f} s; wait, or confirm that the housing is off the rope"
        if not recent & set(STILL_VERDICTS):
            return "whether the load swings is not known; wait, or confirm that the housing is off the rope"
        return None

    def zeroing_refusal(self) -> str | None:
        """Return why the rope is not a plumb line, or None."""
        if self.static_s < MIN_STATIC_S:
            return f"static for {self.static_s:.0f} s; {MIN_STATIC_S:.0f} s are needed, with the load hanging still"
        return None


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
