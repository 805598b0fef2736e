"""The alignment assistant: advice from live tilts, only if the sensor is calibrated and hangs still."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.calibration.alignment.screw_advice import ScrewAdvice, ScrewMechanics, advise, wait
from gateway.messages import Tilt

TILT_WINDOW_S = 2.0
"""Time over which the angles are averaged and their scatter is measured, s. Basis: a choice; noise averages out, and a person who
turns a screw sees its effect."""
MIN_WINDOW_TILTS = 10
"""Least number of tilts of an average. Basis: a choice; half of what a window has at ten tilts per second."""
MAX_WINDOW_TILTS = 64
"""Largest number of tilts of an average, which bounds memory. Basis: a window has 20 at ten tilts per second; three times as many
bound the memory."""
MAX_ANGLE_DEG = 10.0
"""Largest angle of a hanging housing, degrees. Basis: the screws turn it by a few degrees."""


@dataclass(frozen=True, slots=True)
class AlignmentReadout:
    """Angles and advice, for display to the person who turns the screws."""

    pitch_deg: float | None
    """Mean over the averaging time at rest; the newest angle while the housing moves."""
    roll_deg: float | None
    """Mean or newest angle, as `pitch_deg`."""
    u_calibration_deg: float | None
    """Standard uncertainty of the vertical from the calibration, degrees; the screws do not reduce it."""
    advice: ScrewAdvice


class AlignmentAssistant:
    """Averages tilts and advises."""

    def __init__(self, screws: ScrewMechanics | None = None) -> None:
        self._screws = screws
        self._still: deque[tuple[int, float, float]] = deque(maxlen=MAX_WINDOW_TILTS)
        """Time, ns, pitch and roll, degrees, of consecutive tilts at rest."""

    def add_tilt(self, tilt: Tilt) -> AlignmentReadout:
        """Return what to do after this tilt and those before it."""
        pitch_deg, roll_deg = tilt.pitch_deg, tilt.roll_deg
        if tilt.calibration_id is None:
            reason = "no advice: no calibration is in force; recalibrate first"
        elif pitch_deg is None or roll_deg is None or not tilt.trusted:
            reason = "wait: no advice while the load moves or the reading is not trusted"
        elif max(abs(pitch_deg), abs(roll_deg)) > MAX_ANGLE_DEG:
            reason = f"no advice: over {MAX_ANGLE_DEG:.0f} deg off the rope, the housing does not hang"
        else:
            return self._advise_at_rest(tilt, pitch_deg, roll_deg)
        self._still.clear()
        return AlignmentReadout(pitch_deg, roll_deg, tilt.u_deg, wait(reason))

    def _advise_at_rest(self, tilt: Tilt, pitch_deg: float, roll_deg: float) -> AlignmentReadout:
        self._still.append((tilt.time_ns, pitch_deg, roll_deg))
        while tilt.time_ns - self._still[0][0] > TILT_WINDOW_S * 1e9:
            self._still.popleft()
        angles_deg = np.array([entry[1:] for entry in self._still])
        if len(angles_deg) < MIN_WINDOW_TILTS:
            return AlignmentReadout(pitch_deg, roll_deg, tilt.u_deg, wait("wait: the angles are being averaged"))
        pitch_deg, roll_deg = (float(mean) for mean in angles_deg.mean(axis=0))
        advice = advise(
            float(np.radians(pitch_deg)),
            float(np.radians(roll_deg)),
            u_rad=float(np.radians(angles_deg.std(axis=0, ddof=1).max())),
            still=True,
            screws=self._screws,
        )
        return AlignmentReadout(pitch_deg, roll_deg, tilt.u_deg, advice)
