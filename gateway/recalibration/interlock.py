"""What must be true of the load before its sensor may be taken away or set to zero."""

from collections import deque
from dataclasses import dataclass

from gateway.calibration.methods.zeroing import MIN_REST_S
from gateway.messages import Verdict

MEMORY_S = 60.0
MOST_VERDICTS = 600
STATIC_S = MIN_REST_S + 2.0
"""So long a load must have hung still before its rope is taken for a plumb line."""
LOAD_HOLDS_S = 10.0
"""What the crane's own load signal said counts for this long."""
STILL: tuple[Verdict, ...] = ("static", "quasi_static")


@dataclass(frozen=True, slots=True)
class LoadState:
    """What the crane's own load signal said."""

    loaded: bool
    time_ns: int


class LoadInterlock:
    """Remembers the condition's verdicts of the last minute, and the load signal. Times are those of the samples."""

    def __init__(self) -> None:
        self._verdicts: deque[tuple[int, Verdict]] = deque(maxlen=MOST_VERDICTS)
        self._load: LoadState | None = None

    def verdict(self, verdict: Verdict, time_ns: int) -> None:
        """What the condition stage judged."""
        self._verdicts.append((time_ns, verdict))
        while time_ns - self._verdicts[0][0] > MEMORY_S * 1e9:
            self._verdicts.popleft()

    def load(self, said: LoadState) -> None:
        """What a load cell or the crane's controller said."""
        self._load = said

    def forget(self) -> None:
        """What was seen does not speak of what comes."""
        self._verdicts.clear()

    @property
    def static_s(self) -> float:
        """For how long every verdict has been static, up to the newest."""
        moved = [time_ns for time_ns, verdict in self._verdicts if verdict != "static"]
        kept = [time_ns for time_ns, _ in self._verdicts if not moved or time_ns > moved[-1]]
        return (kept[-1] - kept[0]) / 1e9 if kept else 0.0

    def recalibration_refusal(self, *, confirmed: bool, now_ns: int) -> str | None:
        """Why the housing may not be taken off the rope now; None: it may. `confirmed`: that has been done."""
        if self._load is not None and self._load.loaded and now_ns - self._load.time_ns < LOAD_HOLDS_S * 1e9:
            return "the load signal says that a load hangs; its swing must stay watched"
        if confirmed:
            return None
        seen = {verdict for _, verdict in self._verdicts}
        if seen & {"swinging", "disturbed"}:
            return f"the load has moved within the last {MEMORY_S:.0f} s; wait, or confirm that the housing is off the rope"
        if not seen & set(STILL):
            return "whether the load swings is not known; wait, or confirm that the housing is off the rope"
        return None

    def zeroing_refusal(self) -> str | None:
        """Why the rope is not a plumb line now; None: it is."""
        if self.static_s < STATIC_S:
            return f"static for {self.static_s:.0f} s; {STATIC_S:.0f} s are needed, the load hanging still"
        return None
