"""The alignment assistant: advice from live tilts, only if the sensor is calibrated and hangs still.

It says which of the two screws of the housing to turn, which way, and how far (Łuczak et al. 2022, sec. 8). Screw 7a of the
source turns the housing about one axis, 7b about the other. They are not quite independent, so a few rounds are needed, the
larger angle first.
"""

from collections import deque
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gateway.messages import Tilt
from gateway.messages.header import ReasonCode

Screw = Literal["pitch", "roll"]
TOLERANCE_RAD = float(np.radians(0.03))
"""Largest angle of an aligned housing, radians; the source achieved it (Łuczak et al. 2022, eq. 2)."""
K_ALIGNED = 2.0
"""Coverage factor with which the uncertainty of an angle must be within the tolerance. Definition: about 95 % (GUM 6.3)."""
TILT_WINDOW_S = 2.0
"""Time over which the angles are averaged and their scatter is measured, s. Basis: a choice; noise averages out, and a person who
turns a screw sees its effect."""
MIN_WINDOW_TILTS = 10
"""Least number of tilts of an average. Basis: a choice; half of what a window has at ten tilts per second."""
MAX_WINDOW_TILTS = 64
"""Largest number of tilts of an average. Basis: a window has 20 at ten tilts per second; three times as many bound the memory."""
MAX_ANGLE_DEG = 10.0
"""Largest angle of a hanging housing, degrees. Basis: the screws turn it by a few degrees."""


@dataclass(frozen=True, slots=True)
class ScrewMechanics:
    """Dimensions of the two screws, which are equal, and their signs."""

    lead_m: float = 0.5e-3
    """Advance per turn, m; that of an M3 screw."""
    lever_m: float = 40e-3
    """Distance from the hinge to the screw, m."""
    pitch_sign: int = 1
    """+1 if screwing in increases pitch, otherwise -1."""
    roll_sign: int = 1
    """+1 if screwing in increases roll, otherwise -1."""

    def __post_init__(self) -> None:
        if self.lead_m <= 0 or self.lever_m <= 0 or {self.pitch_sign, self.roll_sign} - {1, -1}:
            raise ValueError("a screw has a lead and a lever above 0 m, and its sign is 1 or -1")


@dataclass(frozen=True, slots=True)
class ScrewAdvice:
    """The next action."""

    state: Literal["not_still", "turn", "aligned", "too_noisy"]
    screw: Screw | None
    direction: Literal["in", "out"] | None
    turns: float
    """Number of turns of the screw; 0 if no screw is to be turned."""
    text: str
    code: ReasonCode | None = None
    """Why nothing is to be turned; None: a screw is."""


def advise(
    pitch_rad: float,
    roll_rad: float,
    *,
    u_rad: float,
    screws: ScrewMechanics | None = None,
) -> ScrewAdvice:
    """Return what to do at these angles of the hanging housing, each with the standard uncertainty `u_rad`."""
    screws = screws or ScrewMechanics()
    if not np.isfinite([pitch_rad, roll_rad, u_rad]).all():
        return wait("align_moving", "wait: the housing moves")
    screw: Screw = "pitch" if abs(pitch_rad) >= abs(roll_rad) else "roll"
    angle_rad = pitch_rad if screw == "pitch" else roll_rad
    if abs(angle_rad) <= TOLERANCE_RAD:
        if K_ALIGNED * u_rad > TOLERANCE_RAD:
            words = f"wait: the angle's standard uncertainty is still {np.degrees(u_rad):.3f} deg"
            return ScrewAdvice("too_noisy", None, None, 0.0, words, "align_noisy")
        words = f"aligned: within {np.degrees(TOLERANCE_RAD):.3f} deg"
        return ScrewAdvice("aligned", None, None, 0.0, words, "align_aligned")
    sign = screws.pitch_sign if screw == "pitch" else screws.roll_sign
    direction: Literal["in", "out"] = "out" if sign * angle_rad > 0 else "in"
    turns = float(np.tan(abs(angle_rad)) * screws.lever_m / screws.lead_m)
    text = f"{screw} reads {np.degrees(angle_rad):+.3f} deg: turn the {screw} screw {direction} by {turns:.2f} turns"
    return ScrewAdvice("turn", screw, direction, turns, text)


def wait(code: ReasonCode, reason: str) -> ScrewAdvice:
    """Return the advice to turn nothing, with its reason."""
    return ScrewAdvice("not_still", None, None, 0.0, reason, code)


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
            advice = wait("align_no_calibration", "no advice: no calibration is in force; recalibrate first")
        elif pitch_deg is None or roll_deg is None or not tilt.trusted:
            advice = wait("align_moving", "wait: no advice while the load moves or the reading is not trusted")
        elif max(abs(pitch_deg), abs(roll_deg)) > MAX_ANGLE_DEG:
            words = f"no advice: over {MAX_ANGLE_DEG:.0f} deg off the rope, the housing does not hang"
            advice = wait("align_off_rope", words)
        else:
            return self._advise_at_rest(tilt, pitch_deg, roll_deg)
        self._still.clear()
        return AlignmentReadout(pitch_deg, roll_deg, tilt.u_deg, advice)

    def _advise_at_rest(self, tilt: Tilt, pitch_deg: float, roll_deg: float) -> AlignmentReadout:
        self._still.append((tilt.time_ns, pitch_deg, roll_deg))
        while tilt.time_ns - self._still[0][0] > TILT_WINDOW_S * 1e9:
            self._still.popleft()
        angles_deg = np.array([entry[1:] for entry in self._still])
        if len(angles_deg) < MIN_WINDOW_TILTS:
            return AlignmentReadout(
                pitch_deg, roll_deg, tilt.u_deg, wait("align_averaging", "wait: the angles are being averaged")
            )
        pitch_deg, roll_deg = (float(mean) for mean in angles_deg.mean(axis=0))
        advice = advise(
            float(np.radians(pitch_deg)),
            float(np.radians(roll_deg)),
            u_rad=float(np.radians(angles_deg.std(axis=0, ddof=1).max())),
            screws=self._screws,
        )
        return AlignmentReadout(pitch_deg, roll_deg, tilt.u_deg, advice)
