"""Advice on the two screws of the housing: which one to turn, which way, and how far (Łuczak et al. 2022, sec. 8).

Screw 7a of the source turns the housing about one axis, 7b about the other. They are not quite independent, so a few rounds are
needed, the larger angle first.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Screw = Literal["pitch", "roll"]
TOLERANCE_RAD = float(np.radians(0.03))
"""Largest angle of an aligned housing, radians; the source achieved it (Łuczak et al. 2022, eq. 2)."""
K_ALIGNED = 2.0
"""Coverage factor with which the uncertainty of an angle must be within the tolerance. Definition: about 95 % (GUM 6.3)."""


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


def advise(
    pitch_rad: float,
    roll_rad: float,
    *,
    u_rad: float,
    still: bool,
    screws: ScrewMechanics | None = None,
    tolerance_rad: float = TOLERANCE_RAD,
) -> ScrewAdvice:
    """Return what to do at these angles of the hanging housing, each with the standard uncertainty `u_rad`."""
    screws = screws or ScrewMechanics()
    if not still or not np.isfinite([pitch_rad, roll_rad, u_rad]).all():
        return wait("wait: the housing moves")
    screw: Screw = "pitch" if abs(pitch_rad) >= abs(roll_rad) else "roll"
    angle_rad = pitch_rad if screw == "pitch" else roll_rad
    if abs(angle_rad) <= tolerance_rad:
        if K_ALIGNED * u_rad > tolerance_rad:
            text = f"wait: the angle's standard uncertainty is still {np.degrees(u_rad):.3f} deg"
            return ScrewAdvice("too_noisy", None, None, 0.0, text)
        return ScrewAdvice("aligned", None, None, 0.0, f"aligned: within {np.degrees(tolerance_rad):.3f} deg")
    sign = screws.pitch_sign if screw == "pitch" else screws.roll_sign
    direction: Literal["in", "out"] = "out" if sign * angle_rad > 0 else "in"
    turns = float(np.tan(abs(angle_rad)) * screws.lever_m / screws.lead_m)
    text = f"{screw} reads {np.degrees(angle_rad):+.3f} deg: turn the {screw} screw {direction} by {turns:.2f} turns"
    return ScrewAdvice("turn", screw, direction, turns, text)


def wait(reason: str) -> ScrewAdvice:
    """Return the advice to turn nothing, with its reason."""
    return ScrewAdvice("not_still", None, None, 0.0, reason)
