"""Sine and cosine fit of one full turn about a horizontal axis (Łuczak n.d., eq. 11 and 12), with confidence intervals.

Printed, the equations add the phase shift to the voltage, U = a + b sin(psi) + c, where it is one with the offset a. It
belongs to the argument: U = a + b sin(psi + c). With A = b cos(c) and B = b sin(c) this is linear in a, A and B.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975, student_quantile

IN_PLANE = {0: (1, 2), 1: (0, 2), 2: (0, 1)}
"""For each rotation axis, the axis that follows the sine of the angle and the one that follows its cosine."""
MIN_ANGLES = 12
"""Least number of different angles of a turn. Basis: 30 degrees apart, and nine degrees of freedom beside the three unknowns."""
MAX_GAP_DEG = 60.0
"""Largest gap between neighbouring angles of a full turn, degrees. Basis: a choice; a gap of a sixth leaves sine, cosine and
constant well apart."""
MAX_AXIS_SHARE = 0.5
"""Largest amplitude of the axis along the rotation axis, relative to the smaller one of the two that go round. Basis: a choice;
an axis that is mounted as stated has a few per cent."""
MAX_PHASE_DEG = 10.0
"""Largest phase shift, degrees, of an axis that is mounted as stated; the method asks for 1 degree (Łuczak n.d., sec. 4)."""


@dataclass(frozen=True, slots=True)
class TurnReadings:
    """Readings of one turn, one row per different angle, in the order of the angles."""

    source: str
    """Name of the file."""
    angle_rad: Array
    """Angles of the rig, shape (n,), n rows."""
    mean: Array
    """Mean readings, raw units, shape (n, 3)."""
    count: Array
    """Number of readings in each mean, shape (n,)."""
    reading_sigma: Array | None
    """Standard deviation of one reading at a fixed angle, shape (3,); None if no angle has several readings."""
    temperature_c: Array | None
    """Mean temperatures, shape (n,)."""


@dataclass(frozen=True, slots=True)
class AxisSine:
    """Offset, scale factor and phase shift of one axis in one turn, with their standard uncertainties."""

    axis: int
    offset: float
    u_offset: float
    """Raw units, as offset and scale."""
    scale: float
    """Amplitude, raw units per g."""
    u_scale: float
    phase_rad: float
    u_phase_rad: float
    confidence: float
    """Half-width of the 95 % confidence interval of the curve, raw units, at the angle where it is widest."""
    prediction: float
    """Half-width of the 95 % prediction interval of one more mean reading, raw units, at the angle where it is widest."""


@dataclass(frozen=True, slots=True)
class TurnFit:
    """The curves of the three axes in one turn."""

    readings: TurnReadings
    rotation_axis: int
    """Axis along the rotation axis."""
    coefficients: Array
    """Constant and coefficients of sine and cosine, shape (3, 3): row the quantity, column the axis; raw units."""
    covariance: Array
    """Covariance of the coefficients, by rows, shape (9, 9); scaled so that k = 1.96 covers 95 %."""
    residual: Array
    """Measured minus fitted, raw units, shape (n, 3)."""
    sigma: Array
    """Standard deviation of the residuals, raw units, shape (3,)."""
    condition_number: float

    @property
    def coverage_factor(self) -> float:
        """Student's t of the fit's degrees of freedom for 95 %."""
        return student_quantile(0.975, len(self.residual) - 3)

    def axis_sines(self) -> tuple[AxisSine, AxisSine]:
        """Return the curves of the two axes that go round."""
        sine_axis, cosine_axis = IN_PLANE[self.rotation_axis]
        return self._axis_sine(sine_axis, 1, 2, 1.0), self._axis_sine(cosine_axis, 2, 1, -1.0)

    def _axis_sine(self, axis: int, main: int, other: int, sign: float) -> AxisSine:
        """Return b and c from the coefficients b cos(c), row `main`, and sign b sin(c), row `other`."""
        along, across = self.coefficients[main, axis], sign * self.coefficients[other, axis]
        scale = float(np.hypot(along, across))
        places = [3 * row + axis for row in (0, main, other)]
        covariance = self.covariance[np.ix_(places, places)]
        by_scale = np.array([0, along, sign * across]) / scale
        by_phase = np.array([0, -across, sign * along]) / scale**2
        design = design_matrix(self.readings.angle_rad)
        spread = float(np.sqrt(np.einsum("ni,ij,nj->n", design, np.linalg.inv(design.T @ design), design).max()))
        half_width = self.coverage_factor * self.sigma[axis]
        return AxisSine(
            axis=axis,
            offset=float(self.coefficients[0, axis]),
            u_offset=float(np.sqrt(covariance[0, 0])),
            scale=scale,
            u_scale=float(np.sqrt(by_scale @ covariance @ by_scale)),
            phase_rad=float(np.arctan2(across, along)),
            u_phase_rad=float(np.sqrt(by_phase @ covariance @ by_phase)),
            confidence=float(half_width * spread),
            prediction=float(half_width * np.hypot(1, spread)),
        )


def design_matrix(angle_rad: Array) -> Array:
    """Return the columns 1, sin and cos, shape (n, 3)."""
    return np.column_stack([np.ones_like(angle_rad), np.sin(angle_rad), np.cos(angle_rad)])


def fit_turn(readings: TurnReadings) -> TurnFit:
    """Fit one turn by least squares. Raises `NotDeterminedError` if it is no full turn as the method needs it.

    The covariance follows from the residuals themselves (MacKinnon and White 1985, HC2): an error of the rig's angle acts on an
    axis by the slope of its curve, and on two axes at once, so the residuals are neither uniform nor independent.
    """
    _check_full_turn(readings)
    design = design_matrix(readings.angle_rad)
    inverse = np.linalg.inv(design.T @ design)
    gain = inverse @ design.T
    coefficients = gain @ readings.mean
    residual = readings.mean - design @ coefficients
    freedom = len(design) - 3
    leverage = np.einsum("ni,in->n", design, gain)
    scaled = residual / np.sqrt(1 - leverage)[:, None]
    changes = np.einsum("in,na->nia", gain, scaled).reshape(len(design), 9)
    widening = student_quantile(0.975, freedom) / NORMAL_975
    return TurnFit(
        readings=readings,
        rotation_axis=_find_rotation_axis(readings, coefficients),
        coefficients=coefficients,
        covariance=widening**2 * changes.T @ changes,
        residual=residual,
        sigma=np.sqrt((residual**2).sum(axis=0) / freedom),
        condition_number=float(np.linalg.cond(design)),
    )


def _check_full_turn(readings: TurnReadings) -> None:
    angles_deg = np.sort(np.degrees(readings.angle_rad) % 360)
    if len(angles_deg) < MIN_ANGLES:
        raise NotDeterminedError(
            f"{readings.source}: {len(angles_deg)} different angles; a turn needs {MIN_ANGLES} or more, better 36"
        )
    gaps_deg = np.diff(np.append(angles_deg, angles_deg[0] + 360))
    widest = int(np.argmax(gaps_deg))
    if gaps_deg[widest] > MAX_GAP_DEG:
        raise NotDeterminedError(
            f"{readings.source}: no reading between {angles_deg[widest]:.0f} and "
            f"{(angles_deg[widest] + gaps_deg[widest]) % 360:.0f} deg; turn the sensor through the full circle"
        )


def _find_rotation_axis(readings: TurnReadings, coefficients: Array) -> int:
    """Return the axis along the rotation axis. Raises `NotDeterminedError` if the mounting is not as the method needs it."""
    amplitudes = np.hypot(coefficients[1], coefficients[2])
    rotation_axis = int(np.argmin(amplitudes))
    sine_axis, cosine_axis = IN_PLANE[rotation_axis]
    if amplitudes[rotation_axis] > MAX_AXIS_SHARE * min(amplitudes[sine_axis], amplitudes[cosine_axis]):
        raise NotDeterminedError(
            f"{readings.source}: no axis stays across the vertical; mount the sensor with one axis along the rotation axis"
        )
    phase_deg = float(np.degrees(np.arctan2(coefficients[2, sine_axis], coefficients[1, sine_axis])))
    lag_deg = float(np.degrees(np.arctan2(-coefficients[1, cosine_axis], coefficients[2, cosine_axis])))
    if max(abs(phase_deg), abs(lag_deg)) > MAX_PHASE_DEG:
        raise NotDeterminedError(
            f"{readings.source}: the turn is about {'xyz'[rotation_axis]}, so at angle 0 {'xyz'[cosine_axis]} must point up, and "
            f"{'xyz'[sine_axis]} at 90 deg; the phases are {phase_deg:.0f} and {lag_deg:.0f} deg: shift or negate the angles"
        )
    return rotation_axis
