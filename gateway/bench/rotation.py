"""Rotation calibration: offset, scale factor and non-orthogonality from full turns about horizontal axes (Łuczak n.d., sec. 4).

One turn calibrates the two axes that go round, two turns about different axes all three. Offset and scale factor of an axis come
from the turns in which it goes round; its two phase shifts give its cross-axis sensitivities. The axes that never go round in one
turn together (x and y for turns about y and x) get theirs from the small signal of the axis along the rotation axis.
"""

from dataclasses import dataclass

import numpy as np

from gateway.bench.rotation_turn import IN_PLANE, AxisSine, TurnFit, TurnReadings, fit_turn
from gateway.calibration.calibration_fit import CalibrationFit, Contribution, FitWarning, assemble_fit
from gateway.calibration.pose import Pose
from gateway.calibration.record import ROTATION, NotDeterminedError
from gateway.numerics.array import Array
from gateway.numerics.stats import robust_sigma

MOUNTING_U_DEG = 0.1
"""Standard uncertainty, degrees, of the housing's attitude on the rig in each turn, about each of three directions. Basis: a
machined face on a rig; the method asks for 1 degree (Łuczak n.d., sec. 4)."""
MAX_LEVEL_DEG = 2.0
"""Largest angle between rotation axis and horizontal, degrees. Basis: a choice; a spirit level shows a tenth of it, and 2 degrees
lose 0.06 % of g."""
MAX_TURN_DIFFERENCE = 5.0
"""Largest difference between two turns of an axis that went round in both, in standard uncertainties. Basis: a choice; chance
does not reach it, and an exchanged file does."""

K_OUTLIER = 8.0
"""Robust standard deviations by which a reading stands off its curve. Basis: a choice; of a hundred readings of thirty-six angles
none does by chance, and an angle that is mistyped by a degree does."""


@dataclass(frozen=True, slots=True)
class PairAngle:
    """Non-orthogonality of two axes: the angle between them minus 90 degrees."""

    axes: tuple[int, int]
    angle_rad: float
    u_rad: float
    from_phases: bool
    """Whether the two axes went round in one turn, so that the mounting on the rig does not enter."""


@dataclass(frozen=True, slots=True)
class RotationFit:
    """Result of one turn or two."""

    turns: tuple[TurnFit, ...]
    pairs: tuple[PairAngle, ...]
    level_rad: tuple[float, ...]
    """Elevation of each turn's rotation axis, from the constant reading along it; 0 where one turn alone cannot show it."""
    norm_error_g: float
    """Permissible error of |m| of one more mean reading, dm: largest prediction interval over scale (eq. 14, corrected)."""
    calibration: CalibrationFit | None
    """The fit of all three axes; None for one turn."""


def fit_rotation(turns: tuple[TurnReadings, ...], mounting_u_deg: float = MOUNTING_U_DEG) -> RotationFit:
    """Fit one turn, or two turns about different axes.

    `mounting_u_deg` is the standard uncertainty of the housing's attitude on the rig, about each of three directions: zero of the
    angle against the vertical, and the rotation axis against the housing. Raises `NotDeterminedError` if the readings are not
    such turns.
    """
    fits = tuple(fit_turn(turn) for turn in turns)
    if len(fits) > 2 or len({fit.rotation_axis for fit in fits}) < len(fits):
        axes = " and ".join("xyz"[fit.rotation_axis] for fit in fits)
        raise NotDeterminedError(f"turns about {axes}: give one turn, or two about different axes")
    sines = [sine for fit in fits for sine in fit.axis_sines()]
    dm = max(sine.prediction / sine.scale for sine in sines)  # eq. 14
    if len(fits) == 1:
        return RotationFit(fits, (_phase_pair(fits[0]),), (0.0,), dm, None)
    return _fit_two_turns(fits, dm, np.radians(mounting_u_deg))


def _phase_pair(fit: TurnFit) -> PairAngle:
    """Return the non-orthogonality of the axes that went round: the difference of their phase shifts."""
    sine, cosine = fit.axis_sines()
    difference_by = np.zeros(9)
    for phase, main, other, factor in ((sine, 1, 2, -1.0), (cosine, 2, 1, 1.0)):
        sign = 1.0 if main == 1 else -1.0
        along, across = np.cos(phase.phase_rad), np.sin(phase.phase_rad)
        difference_by[3 * main + phase.axis] = -factor * across / phase.scale
        difference_by[3 * other + phase.axis] = factor * sign * along / phase.scale
    u_rad = float(np.sqrt(difference_by @ fit.covariance @ difference_by))
    return PairAngle((sine.axis, cosine.axis), cosine.phase_rad - sine.phase_rad, u_rad, from_phases=True)


def _fit_two_turns(fits: tuple[TurnFit, ...], dm: float, mounting_u_rad: float) -> RotationFit:
    choice = _choice([fit.rotation_axis for fit in fits])
    stacked = np.concatenate([fit.coefficients.ravel() for fit in fits])
    level_rad = _levels(fits, choice @ stacked)
    stacked = np.concatenate(
        [_level(fit, level, choice @ stacked).ravel() for fit, level in zip(fits, level_rad, strict=True)]
    )
    sensitivity, offset = np.reshape((choice @ stacked)[:9], (3, 3)), (choice @ stacked)[9:]
    matrix = np.asarray(np.linalg.inv(sensitivity))
    noise = np.zeros((18, 18))
    noise[:9, :9], noise[9:, 9:] = fits[0].covariance, fits[1].covariance
    mounting = _mounting_changes(fits, sensitivity, mounting_u_rad)
    noise_covariance, mounting_covariance = choice @ noise @ choice.T, choice @ mounting @ mounting.T @ choice.T
    to_correction = np.zeros((12, 12))
    to_correction[:9, :9], to_correction[9:, 9:] = -np.kron(matrix, matrix.T), np.eye(3)
    contributions = (
        Contribution("residuals of the curves", "A", to_correction @ noise_covariance @ to_correction.T),
        Contribution("attitude of the housing on the rig", "B", to_correction @ mounting_covariance @ to_correction.T),
    )
    poses = tuple(pose for fit in fits for pose in _poses(fit))
    residual_g = np.concatenate([fit.residual for fit in fits]) @ matrix.T
    calibration = assemble_fit(
        ROTATION,
        matrix=matrix,
        offset=offset,
        sensitivity=sensitivity,
        contributions=contributions,
        poses=poses,
        residual_rms_g=float(np.sqrt(np.mean(residual_g**2))),
        condition_number=max(fit.condition_number for fit in fits),
        warnings=_difference_warnings(fits) + _outliers(fits),
    )
    wobble = _wobble_pair(fits, sensitivity, noise_covariance + mounting_covariance)
    return RotationFit(fits, (*map(_phase_pair, fits), wobble), level_rad, dm, calibration)


def _choice(rotation_axes: list[int]) -> Array:
    """Return the matrix from both turns' coefficients (18) to sensitivity by rows and offset (12), shape (12, 18)."""
    choice = np.zeros((12, 18))
    for axis in range(3):
        around = [turn for turn, rotation_axis in enumerate(rotation_axes) if rotation_axis != axis]
        for turn in around:
            choice[9 + axis, 9 * turn + axis] = 1 / len(around)
        for direction in range(3):
            for turn, weight in _sources(axis, direction, rotation_axes):
                row = 1 + IN_PLANE[rotation_axes[turn]].index(direction)
                choice[3 * axis + direction, 9 * turn + 3 * row + axis] = weight
    return choice


def _sources(axis: int, direction: int, rotation_axes: list[int]) -> list[tuple[int, float]]:
    """Return the turns, with weights, in which `axis` shows its sensitivity along `direction`: best where both go round."""
    seen = [turn for turn, rotation_axis in enumerate(rotation_axes) if rotation_axis != direction]
    best = [turn for turn in seen if rotation_axes[turn] != axis] or seen
    return [(turn, 1 / len(best)) for turn in best]


def _levels(fits: tuple[TurnFit, ...], parameters: Array) -> tuple[float, ...]:
    """Return the elevation of each rotation axis. Raises `NotDeterminedError` if one is far from the horizontal."""
    levels = []
    for fit in fits:
        axis = fit.rotation_axis
        sine = (fit.coefficients[0, axis] - parameters[9 + axis]) / parameters[4 * axis]
        if abs(sine) > np.sin(np.radians(MAX_LEVEL_DEG)):
            raise NotDeterminedError(
                f"{fit.readings.source}: the rotation axis is {np.degrees(np.arcsin(np.clip(sine, -1, 1))):.1f} deg off the "
                f"horizontal; level the rig to within {MAX_LEVEL_DEG:g} deg"
            )
        levels.append(float(np.arcsin(sine)))
    return tuple(levels)


def _level(fit: TurnFit, level_rad: float, parameters: Array) -> Array:
    """Return the coefficients as of a horizontal rotation axis: gravity has the sine of the elevation along it."""
    levelled = fit.coefficients.copy()
    levelled[0] -= np.reshape(parameters[:9], (3, 3))[:, fit.rotation_axis] * np.sin(level_rad)
    levelled[1:] /= np.cos(level_rad)
    return levelled


def _mounting_changes(fits: tuple[TurnFit, ...], sensitivity: Array, u_rad: float) -> Array:
    """Return the changes of both turns' coefficients by one standard uncertainty of each rotation, shape (18, 6)."""
    changes = np.zeros((18, 6))
    for turn, fit in enumerate(fits):
        for about in range(3):
            for row, direction in enumerate(IN_PLANE[fit.rotation_axis], start=1):
                change = sensitivity @ np.cross(np.eye(3)[about], np.eye(3)[direction]) * u_rad
                changes[9 * turn + 3 * row : 9 * turn + 3 * row + 3, 3 * turn + about] = change
    return changes


def _poses(fit: TurnFit) -> list[Pose]:
    """Return a pose per angle; the scatter about the curve counts where it exceeds that of readings at one angle."""
    readings = fit.readings
    poses = []
    for place, (mean, count) in enumerate(zip(readings.mean, readings.count, strict=True)):
        u = fit.sigma if readings.reading_sigma is None else readings.reading_sigma / np.sqrt(count)
        one = np.maximum(fit.sigma, u * np.sqrt(count))
        temperature_c = None if readings.temperature_c is None else float(readings.temperature_c[place])
        (x, y, z), (ux, uy, uz), (sx, sy, sz) = mean.tolist(), u.tolist(), one.tolist()
        poses.append(Pose((x, y, z), (ux, uy, uz), int(count), None, temperature_c=temperature_c, noise=(sx, sy, sz)))
    return poses


def _difference_warnings(fits: tuple[TurnFit, ...]) -> list[FitWarning]:
    """Return a warning where an axis that went round in both turns has another offset or scale in each."""
    first, second = ({sine.axis: sine for sine in fit.axis_sines()} for fit in fits)
    warnings = []
    for axis in first.keys() & second.keys():
        one, other = first[axis], second[axis]
        for name, difference, u in (
            ("offset", one.offset - other.offset, np.hypot(one.u_offset, other.u_offset)),
            ("scale factor", one.scale - other.scale, np.hypot(one.u_scale, other.u_scale)),
        ):
            if abs(difference) > MAX_TURN_DIFFERENCE * u:
                text = f"{name} {'xyz'[axis]} differs by {1000 * abs(difference) / one.scale:.2f} mg between the turns"
                warnings.append(FitWarning(text, is_outlier=True))
    return warnings


def _outliers(fits: tuple[TurnFit, ...]) -> list[FitWarning]:
    """Return a warning for each angle whose reading stands off its curve by more than the others scatter."""
    warnings = []
    for fit in fits:
        scale = max(sine.scale for sine in fit.axis_sines())
        off = np.abs(fit.residual)
        for place in np.flatnonzero((off > K_OUTLIER * robust_sigma(fit.residual)).any(axis=1)):
            text = (
                f"{fit.readings.source}: the reading at {np.degrees(fit.readings.angle_rad[place]):g} deg stands "
                f"{1000 * off[place].max() / scale:.1f} mg off its curve; check the angle, and read it again"
            )
            warnings.append(FitWarning(text, is_outlier=True))
    return warnings


def _wobble_pair(fits: tuple[TurnFit, ...], sensitivity: Array, covariance: Array) -> PairAngle:
    """Return the non-orthogonality of the two rotation axes' own axes, given their covariance with the offset, shape (12, 12)."""
    one, other = sorted(fit.rotation_axis for fit in fits)
    by = np.zeros(12)
    by[3 * one + other], by[3 * other + one] = -1 / sensitivity[one, one], -1 / sensitivity[other, other]
    angle_rad = float(by[:9] @ sensitivity.ravel())
    return PairAngle((one, other), angle_rad, float(np.sqrt(by @ covariance @ by)), from_phases=False)


def all_sines(fit: RotationFit) -> list[tuple[TurnFit, AxisSine]]:
    """Return the curves of all turns, each with its turn."""
    return [(turn, sine) for turn in fit.turns for sine in turn.axis_sines()]
