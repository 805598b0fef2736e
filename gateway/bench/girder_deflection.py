"""Deflection of a girder from the rotations of its ends, with its uncertainty.

An offset of the inward axis cancels in the difference that a rotation is. Scale factors of the inward and of the vertical axis,
and the zero-g offset of the vertical axis, multiply the angle (Zhu et al. 2020, eq. 10 and 11).

The girder is simply supported, with two equal loads at the same distance from mid-span, such as the wheels of a trolley.
Equation 25 of Zhu et al. 2020 is right. Equation 26 prints l^2 + 2bl - b^2; by the theory from which it comes the factor is l^2
+ bl - b^2/2, with the load as the sum of both. For the source's girder the printed one is 7.2 % too large.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from gateway.calibration.correction import Correction
from gateway.calibration.record import CalibrationRecord
from gateway.numerics.array import Array

DIMENSION_STEP = 1e-6
"""Step of the differences by a dimension, relative to the half span. Basis: a choice; between rounding and curvature, above the
root of rounding (1.5e-8)."""
UNKNOWN_RELATIVE_U = 0.03
"""Relative standard uncertainty of an angle of a sensor without a calibration. Basis: the sensitivity of an uncalibrated sensor,
`correction.UNCALIBRATED_SCALE_FACTOR_U`."""
MAX_ROTATION_RAD = math.radians(5.0)
"""Largest rotation for which small-angle bending holds (Zhu et al. 2020, sec. 2.2)."""
OFF_CENTRE_LIMIT = 0.1
"""Largest distance of the load from mid-span over the span. Basis: beyond it eq. 25 errs by more than 2 %."""
ASYMMETRY_PER_OFF_CENTRE = 2 / 3
"""Difference over sum of both rotations, per distance of the load from mid-span over the span, for a single load. Definition: of
a beam on two supports."""
DEFLECTION_AVERAGE_S = 1.0
"""Time over which tilts are averaged. Basis: several periods of a girder's own vibration."""
K_OFF_CENTRE = 3.0
"""Standard uncertainties beyond which a difference is named. Basis: a choice; 0.3 % by chance."""
InwardAxis = tuple[int, int]
"""Index (0 to 2) and sign of the housing axis that points from a support to mid-span."""


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


def relative_u(u_zero_g_offset_g: Array, u_scale_factor: Array, inward: int, vertical: int = 2) -> float:
    """Return the relative standard uncertainty of a relative angle from the uncertainties by axis, shape (3,)."""
    return math.hypot(
        float(u_zero_g_offset_g[vertical]), float(u_scale_factor[inward]), float(u_scale_factor[vertical])
    )


def relative_u_of_correction(correction: Correction | None, recorded_error_g: float, inward: int) -> float:
    """Return it for a recording: by its correction, or by the permissible error of readings in g of unknown origin."""
    if correction is None:
        return recorded_error_g / math.sqrt(3)
    return relative_u(correction.u_zero_g_offset_g, correction.u_scale_factor, inward)


def relative_u_of_record(record: CalibrationRecord | None, inward: int) -> float:
    """Return it for the record in force of a live gateway; the axes map only changes the order of alike axes."""
    if record is None:
        return UNKNOWN_RELATIVE_U
    return relative_u(record.u_zero_g_offset_g, record.u_scale_factor, inward)


@dataclass(frozen=True, slots=True)
class EndRotation:
    """Rotation of one end against its zero; positive when the girder sags."""

    rotation_rad: float
    u_random_rad: float
    """Standard uncertainty from noise and the zero."""
    u_relative: float
    """Relative standard uncertainty from scale factors and the zero-g offset of the vertical axis."""

    @property
    def u_rad(self) -> float:
        """Combined standard uncertainty."""
        return math.hypot(self.u_random_rad, self.u_relative * self.rotation_rad)


@dataclass(frozen=True, slots=True)
class Deflection:
    """Deflection at mid-span, positive downwards."""

    deflection_m: float
    u_m: float
    left_rad: float
    right_rad: float
    off_centre: float | None
    """Distance of the load from mid-span over the span, towards the left end; None where the rotations do not show it."""
    warnings: tuple[str, ...]


def inward_tilt_rad(force_g: Array, axis: InwardAxis) -> Array:
    """Return the tilt of the inward axis, positive upwards, of specific forces (..., 3) (Zhu et al. 2020, eq. 1 and 2)."""
    index, sign = axis
    across = np.sqrt(sum(force_g[..., other] ** 2 for other in range(3) if other != index))
    return np.asarray(np.arctan2(sign * force_g[..., index], across))


def girder_deflection(left: EndRotation, right: EndRotation, girder: Girder) -> Deflection:
    """Return the deflection from the mean of both rotations (Zhu et al. 2020, eq. 25).

    Unequal rotations show a load off mid-span. To second order in its distance e over the span, eq. 25 is then 2 e^2 too large,
    relative; this is included in the uncertainty.
    """
    mean_rad = (left.rotation_rad + right.rotation_rad) / 2
    u_mean_rad = math.hypot(left.u_rad, right.u_rad) / 2
    off_centre, u_off_centre = _off_centre(left, right)
    is_shown = abs(off_centre) > K_OFF_CENTRE * u_off_centre
    deflection_m = girder.factor_m * mean_rad
    model_m = 2 * off_centre**2 * deflection_m if is_shown else 0.0
    return Deflection(
        deflection_m=deflection_m,
        u_m=math.hypot(girder.factor_m * u_mean_rad, girder.u_factor_m * mean_rad, model_m),
        left_rad=left.rotation_rad,
        right_rad=right.rotation_rad,
        off_centre=off_centre if is_shown else None,
        warnings=tuple(_warnings(left, right, off_centre if is_shown else 0.0)),
    )


def _off_centre(left: EndRotation, right: EndRotation) -> tuple[float, float]:
    """Return the distance of the load from mid-span over the span, and its standard uncertainty; infinite without a load."""
    total_rad = left.rotation_rad + right.rotation_rad
    if total_rad == 0:
        return 0.0, math.inf
    asymmetry = (left.rotation_rad - right.rotation_rad) / total_rad
    u_asymmetry = 2 * math.hypot(right.rotation_rad * left.u_rad, left.rotation_rad * right.u_rad) / total_rad**2
    return asymmetry / ASYMMETRY_PER_OFF_CENTRE, u_asymmetry / ASYMMETRY_PER_OFF_CENTRE


def _is_opposed(left: EndRotation, right: EndRotation) -> bool:
    """Return whether one end sags while the other rises, both beyond their uncertainty."""
    return left.rotation_rad * right.rotation_rad < 0 and all(
        abs(end.rotation_rad) > K_OFF_CENTRE * end.u_rad for end in (left, right)
    )


def _warnings(left: EndRotation, right: EndRotation, off_centre: float) -> list[str]:
    texts = []
    largest_rad = max(abs(left.rotation_rad), abs(right.rotation_rad))
    if largest_rad > MAX_ROTATION_RAD:
        texts.append(
            f"an end turned by {math.degrees(largest_rad):.1f} deg: no small bending; check the axes and the zero"
        )
    if _is_opposed(left, right):
        texts.append(
            "the ends turn in opposite senses, which no load between two supports does: an axis is the wrong way round "
            "(--left-axis, --right-axis), or a sensor has slipped"
        )
    elif left.rotation_rad + right.rotation_rad < -2 * K_OFF_CENTRE * math.hypot(left.u_rad, right.u_rad):
        texts.append("the girder rises: left and right are exchanged, or the zero was taken under load")
    elif abs(off_centre) > OFF_CENTRE_LIMIT:
        side = "left" if off_centre > 0 else "right"
        texts.append(f"the load stands off mid-span by {abs(off_centre) * 100:.0f} % of the span to the {side}")
    return texts
