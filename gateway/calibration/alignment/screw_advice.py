"""The aligning assistant: which of the two screws of the housing on the rope, which way, how much (000 sec. 8).

Screw 7a turns the housing about one axis and 7b about the other; the two are not quite independent, so a few rounds are needed,
the larger angle first.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Screw = Literal["pitch", "roll"]
TOLERANCE_RAD = float(np.radians(0.03))
"""What the source reached (eq. 2)."""
COVERAGE = 2.0


@dataclass(frozen=True, slots=True)
class ScrewMechanics:
    """The two screws, alike."""

    lead_m: float = 0.5e-3
    """Advance per turn: M3."""
    lever_m: float = 40e-3
    """From the hinge to the screw."""
    pitch_sign: int = 1
    """+1 where screwing in makes pitch grow."""
    roll_sign: int = 1

    def __post_init__(self) -> None:
        if self.lead_m <= 0 or self.lever_m <= 0 or {self.pitch_sign, self.roll_sign} - {1, -1}:
            raise ValueError("a screw has a lead and a lever above 0 m, and its sign is 1 or -1")


@dataclass(frozen=True, slots=True)
class AligningAdvice:
    """What to do now."""

    state: Literal["not_still", "turn", "aligned", "too_noisy"]
    screw: Screw | None
    direction: Literal["in", "out"] | None
    turns: float
    """Of that screw; 0 where nothing is to be turned."""
    text: str


def advise(
    pitch_rad: float,
    roll_rad: float,
    *,
    u_rad: float,
    still: bool,
    screws: ScrewMechanics | None = None,
    tolerance_rad: float = TOLERANCE_RAD,
) -> AligningAdvice:
    """What to do at these angles of the hanging housing, radians, with standard uncertainty `u_rad` of either."""
    screws = screws or ScrewMechanics()
    if not still or not np.isfinite([pitch_rad, roll_rad, u_rad]).all():
        return AligningAdvice("not_still", None, None, 0.0, "wait: the housing moves")
    screw: Screw = "pitch" if abs(pitch_rad) >= abs(roll_rad) else "roll"
    angle_rad = pitch_rad if screw == "pitch" else roll_rad
    angle_deg = np.degrees(angle_rad)
    if abs(angle_rad) <= tolerance_rad:
        if COVERAGE * u_rad > tolerance_rad:
            return AligningAdvice("too_noisy", None, None, 0.0, f"wait: known to {np.degrees(u_rad):.3f} deg only")
        return AligningAdvice("aligned", None, None, 0.0, f"aligned: within {np.degrees(tolerance_rad):.3f} deg")
    sign = screws.pitch_sign if screw == "pitch" else screws.roll_sign
    direction: Literal["in", "out"] = "out" if sign * angle_rad > 0 else "in"
    turns = float(np.tan(abs(angle_rad)) * screws.lever_m / screws.lead_m)
    return AligningAdvice(
        "turn",
        screw,
        direction,
        turns,
        f"{screw} reads {angle_deg:+.3f} deg: turn the {screw} screw {direction} by {turns:.2f} turns",
    )
