"""The aligning assistant on live readings: advice only from a sensor that is calibrated and hangs still."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.calibration.alignment.screw_advice import AligningAdvice, ScrewMechanics, advise
from gateway.messages import Tilt

WINDOW_S = 2.0
"""Angles are averaged over this long, and their scatter is seen in it."""
FEWEST = 10
MOST = 64
FARTHEST_DEG = 10.0
"""Beyond, the housing does not hang; two screws turn it by a few degrees."""


@dataclass(frozen=True, slots=True)
class AligningView:
    """What whoever holds the screwdriver is shown."""

    pitch_deg: float | None
    roll_deg: float | None
    """Means of the last seconds at rest; while it moves, the newest."""
    u_calibration_deg: float | None
    """Standard uncertainty of the vertical by the calibration: no turning of screws makes it less."""
    advice: AligningAdvice


class Aligning:
    """Takes tilts as they come."""

    def __init__(self, screws: ScrewMechanics | None = None) -> None:
        self._screws = screws
        self._still: deque[tuple[int, float, float]] = deque(maxlen=MOST)
        """(time, pitch, roll in degrees), in a row at rest."""

    def add_samples(self, tilt: Tilt) -> AligningView:
        """What to do, by this tilt and those before it."""
        pitch_deg, roll_deg = tilt.pitch_deg, tilt.roll_deg
        if tilt.calibration_id is None:
            why = "no advice: no calibration is in force; recalibrate first"
        elif pitch_deg is None or roll_deg is None or not tilt.trusted:
            why = "wait: no advice while the load moves or the reading is not trusted"
        elif max(abs(pitch_deg), abs(roll_deg)) > FARTHEST_DEG:
            why = f"no advice: over {FARTHEST_DEG:.0f} deg off the rope, the housing does not hang"
        else:
            return self._advised(tilt, pitch_deg, roll_deg)
        self._still.clear()
        return AligningView(pitch_deg, roll_deg, tilt.u_deg, _nothing(why))

    def _advised(self, tilt: Tilt, pitch_deg: float, roll_deg: float) -> AligningView:
        self._still.append((tilt.time_ns, pitch_deg, roll_deg))
        while tilt.time_ns - self._still[0][0] > WINDOW_S * 1e9:
            self._still.popleft()
        angles_deg = np.array([entry[1:] for entry in self._still])
        if len(angles_deg) < FEWEST:
            return AligningView(pitch_deg, roll_deg, tilt.u_deg, _nothing("wait: the angles are being averaged"))
        pitch_deg, roll_deg = (float(mean) for mean in angles_deg.mean(axis=0))
        advice = advise(
            float(np.radians(pitch_deg)),
            float(np.radians(roll_deg)),
            u_rad=float(np.radians(angles_deg.std(axis=0, ddof=1).max())),
            still=True,
            screws=self._screws,
        )
        return AligningView(pitch_deg, roll_deg, tilt.u_deg, advice)


def _nothing(why: str) -> AligningAdvice:
    return AligningAdvice("not_still", None, None, 0.0, why)
