"""A simply supported girder with two equal loads at the same distance from mid-span, such as the wheels of a trolley.

Equation 25 of Zhu et al. 2020 is right. Equation 26 prints l^2 + 2bl - b^2; by the theory from which it comes the factor is
l^2 + bl - b^2/2, with the load as the sum of both. For the source's girder the printed one is 7.2 % too large.
"""

from dataclasses import dataclass, replace

DIMENSION_STEP = 1e-6
"""Step of the differences by a dimension, relative to the half span. Basis: a choice; between rounding and curvature, above the
root of rounding (1.5e-8)."""


@dataclass(frozen=True, slots=True)
class Girder:
    """Dimensions of a girder."""

    half_span_m: float
    """Half the distance of the supports, l."""
    load_offset_m: float = 0.0
    """Distance of each of the two loads from mid-span, b; 0 for a single load."""
    u_half_span_m: float = 0.0
    u_load_offset_m: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.load_offset_m < self.half_span_m:
            raise ValueError("the loads stand between the supports: 0 <= load_offset_m < half_span_m")

    @property
    def factor_m(self) -> float:
        """Deflection at mid-span per rotation of the ends, m/rad (eq. 25)."""
        l, b = self.half_span_m, self.load_offset_m  # noqa: E741
        return 2 * (l**2 + l * b - b**2 / 2) / (3 * (l + b))

    @property
    def u_factor_m(self) -> float:
        """Standard uncertainty of the factor from those of the dimensions, m/rad."""
        step_m = DIMENSION_STEP * self.half_span_m
        by_span = (replace(self, half_span_m=self.half_span_m + step_m).factor_m - self.factor_m) / step_m
        inward = self.load_offset_m + step_m >= self.half_span_m
        moved = replace(self, load_offset_m=self.load_offset_m + (-step_m if inward else step_m))
        by_offset = (moved.factor_m - self.factor_m) / (moved.load_offset_m - self.load_offset_m)
        return float(((by_span * self.u_half_span_m) ** 2 + (by_offset * self.u_load_offset_m) ** 2) ** 0.5)


def deflection_under_load_m(load_n: float, stiffness_n_m2: float, girder: Girder) -> float:
    """Return the deflection at mid-span under the sum of both loads, for the bending stiffness EI (eq. 26, corrected)."""
    l, b = girder.half_span_m, girder.load_offset_m  # noqa: E741
    return load_n * (l - b) * (l**2 + b * l - b**2 / 2) / (6 * stiffness_n_m2)


def end_rotation_under_load_rad(load_n: float, stiffness_n_m2: float, girder: Girder) -> float:
    """Return the rotation of each end under the sum of both loads, the quotient of eq. 26 and 25."""
    return load_n * (girder.half_span_m**2 - girder.load_offset_m**2) / (4 * stiffness_n_m2)
