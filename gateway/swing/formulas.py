"""The four published formulas for phi_max (Łuczak et al. 2022), as printed, and inverted for the housing's place on the rope.

    eq. 22  arccos(min a_z)                   eq. 23  arcsin(sqrt(max(a_x)^2 + max(a_y)^2))
    eq. 24  arctan(sqrt(max(a_x)^2 + max(a_y)^2)/min a_z)
    eq. 25  arccos(1.5 - max(a_z)/2)          accelerations in g

An argument outside the domain of a formula gives None and never a limited angle: an arccosine of 1.001 is not 0 degrees but a
reading that the formula cannot explain. The source states no range of validity. `VALID_RHO` does, for an ideal planar swing about
the vertical: with rho the distance of the housing from the pivot over that of the load, the largest transverse reading is
(1 - rho) sin(phi_max), the smallest axial one cos(phi_max), the largest axial one 1 + 2 rho (1 - cos(phi_max)).
"""

import math
from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.estimate import FormulaAngles

VALID_RHO = {
    "arccos_min_az": (0.0, 1.0),
    "arcsin_max_axy": (0.0, 0.05),
    "arctan_max_axy_min_az": (0.0, 0.05),
    "arccos_max_az": (0.9, 1.0),
}
"""Definition: ranges of rho in which a formula as published is right to 5 % of the angle on an ideal planar swing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremes:
    """The extremes of specific force that the formulas use, in g."""

    max_x_g: float
    max_y_g: float
    max_across_g: float
    """Largest sqrt(a_x^2 + a_y^2) of any one sample."""
    min_z_g: float
    max_z_g: float

    def joined(self, other: "Extremes") -> "Extremes":
        """Return the extremes of both intervals together."""
        return Extremes(
            max_x_g=max(self.max_x_g, other.max_x_g),
            max_y_g=max(self.max_y_g, other.max_y_g),
            max_across_g=max(self.max_across_g, other.max_across_g),
            min_z_g=min(self.min_z_g, other.min_z_g),
            max_z_g=max(self.max_z_g, other.max_z_g),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LowpassGain:
    """Gain of a low-pass at the frequency of the swing and at twice that; the corrected formulas divide by it."""

    gain_f0: float = 1.0
    gain_2f0: float = 1.0


def extremes(force_g: Array) -> Extremes | None:
    """Return the extremes of specific force, shape (n, 3); None for no samples."""
    if len(force_g) == 0:
        return None
    x, y, z = force_g.T
    return Extremes(
        max_x_g=float(x.max()),
        max_y_g=float(y.max()),
        max_across_g=float(np.hypot(x, y).max()),
        min_z_g=float(z.min()),
        max_z_g=float(z.max()),
    )


def as_published(e: Extremes) -> FormulaAngles:
    """Return the angles of eq. 22 to 25 exactly as printed."""
    across = math.sqrt(e.max_x_g**2 + e.max_y_g**2)
    return FormulaAngles(
        arccos_min_az=_arccos(e.min_z_g),
        arcsin_max_axy=_arcsin(across),
        arctan_max_axy_min_az=math.atan(across / e.min_z_g) if e.min_z_g > 0 else None,
        arccos_max_az=_arccos(1.5 - e.max_z_g / 2),
    )


def corrected(e: Extremes, rho: float, lowpass: LowpassGain | None = None) -> FormulaAngles:
    """Return the angles of the same formulas inverted for a housing at `rho` in [0, 1] behind a low-pass.

    An angle is None also where rho leaves nothing to invert. Eq. 23 and 24 use the largest sqrt(a_x^2 + a_y^2) of a sample, which
    is right for elliptical swings too. A lean is not taken into account.
    """
    lowpass = lowpass or LowpassGain()
    across = e.max_across_g / lowpass.gain_f0
    centre, half = (e.max_z_g + e.min_z_g) / 2, (e.max_z_g - e.min_z_g) / (2 * lowpass.gain_2f0)
    low, high = centre - half, centre + half
    across_load = across / (1 - rho) if rho < 1 else math.inf
    return FormulaAngles(
        arccos_min_az=_arccos(low),
        arcsin_max_axy=_arcsin(across_load),
        arctan_max_axy_min_az=math.atan(across_load / low) if low > 0 and math.isfinite(across_load) else None,
        arccos_max_az=_arccos(1 - (high - 1) / (2 * rho)) if rho > 0 else None,
    )


def _arccos(argument: float) -> float | None:
    return math.acos(argument) if -1 <= argument <= 1 else None


def _arcsin(argument: float) -> float | None:
    return math.asin(argument) if -1 <= argument <= 1 else None
