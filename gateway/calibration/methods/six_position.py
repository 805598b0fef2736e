"""Six-position calibration: offset and scale (Łuczak et al. 2022, eq. 4 to 12) and the affine model with its covariance.

The matrix of the record is the affine one: an axis that is misaligned by a few degrees must be corrected (2 % of cross-axis
sensitivity is 1.1 degrees). Its off-diagonal entries are only as good as the placement of the faces, and the covariance
contains that. Placement acts across the vertical in the first order and along it in the second (eq. 3). The offset and scale of
an axis therefore come from its two extremes alone, as in eq. 4 to 9; its readings on the four other faces determine the
off-diagonal entries and check the fit.

Outliers among the readings of a face are found within one session.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.calibration_fit import (
    K_OUTLIER,
    CalibrationFit,
    Contribution,
    FitWarning,
    assemble_fit,
    total_covariance,
)
from gateway.calibration.methods.non_linearity import find_non_linearity, non_linearity_contribution
from gateway.calibration.pose import (
    FACE_DIRECTIONS,
    FACES,
    PLACEMENT_U_DEG,
    Face,
    Pose,
    describe_direction,
    without_tilted_poses,
)
from gateway.calibration.record import NotDeterminedError, PoseMethod
from gateway.numerics.array import Array
from gateway.numerics.stats import CHANCE_LEVEL, chi_square_quantile

MIN_OUTLIER_G = 1e-6
"""Least deviation of an outlier, g. Basis: above the rounding errors of a perfect fit."""

WEIGHT_ACROSS = 1e-6
"""Weight of a reading across the vertical relative to one along it. Basis: the limit in which placement errs far more than
noise."""
MIN_CHECKED_SHARE = 1e-3
"""Least uncertainty of a residual, relative to the largest, that checks the fit; the fit passes through the other readings.
Basis: a choice; above rounding; residuals that check the fit have a share of some tenths."""


def find_outliers(poses: tuple[Pose, ...], residual_g: Array, u_g: Array) -> list[FitWarning]:
    """Return the readings that deviate from the fit by more than the placement explains.

    Residuals and their standard uncertainties, shape (p, 3), g. Two opposite faces share their residual, so both are named.
    """
    faces: dict[str, list[str]] = {}
    for pose, axis in np.argwhere(residual_g > np.maximum(K_OUTLIER * u_g, MIN_OUTLIER_G)):
        text = f"U_{'xyz'[axis]} stands {residual_g[pose, axis] * 1000:.1f} mg off the other positions"
        faces.setdefault(text, []).append(str(poses[pose].face))
    return [
        FitWarning(f"{text} with {' or '.join(names)} up; lay that face again", is_outlier=True)
        for text, names in faces.items()
    ]


@dataclass(frozen=True, slots=True)
class FaceExtremes:
    """Offset and scale factor of each axis from its two extremes (Łuczak et al. 2022, eq. 4 to 9), raw units."""

    offset: Array
    """Half of the sum of the extremes, shape (3,)."""
    scale: Array
    """Half of the difference of the extremes, raw units per g, shape (3,)."""
    type_a: Array
    """Standard uncertainty, type A, of both, shape (3,)."""


@dataclass(frozen=True, slots=True)
class _FaceReadings:
    """Poses as arrays: p poses, three axes, raw units."""

    mean: Array
    """Means, shape (p, 3)."""
    up: Array
    """Unit vectors to the vertical, shape (p, 3)."""
    noise_u: Array
    """Standard uncertainty by noise, shape (p, 3)."""
    quantisation_u: Array
    """Standard uncertainty by quantisation, shape (p, 3)."""
    placement: Array
    """Change of the means by one standard uncertainty of each placement, shape (3p, p, 3).

    Across the vertical it acts in the first order, along it by 1 - cos (Łuczak et al. 2022, eq. 3).
    """

    @property
    def variance(self) -> Array:
        return np.asarray(self.noise_u**2 + self.quantisation_u**2 + (self.placement**2).sum(axis=0))


def missing_faces(poses: tuple[Pose, ...]) -> tuple[Face, ...]:
    """Return the faces without a usable pose."""
    present = {pose.face for pose in poses if pose.used}
    return tuple(face for face in FACES if face not in present)


def face_means(poses: tuple[Pose, ...]) -> tuple[Array, Array]:
    """Return mean and type A uncertainty of each face, repeats averaged, in the order of `FACES`, each of shape (6, 3).

    Raises `NotDeterminedError` with the missing faces.
    """
    if missing := missing_faces(poses):
        attitudes = " then ".join(describe_direction(FACE_DIRECTIONS[face]) for face in missing)
        names = f"face{'s' if len(missing) > 1 else ''} {', '.join(missing)}"
        raise NotDeterminedError(f"{names} missing: lay the sensor with {attitudes}")
    groups = [[pose for pose in poses if pose.used and pose.face == face] for face in FACES]
    mean = np.array([np.mean([pose.mean for pose in group], axis=0) for group in groups])
    type_a = np.array(
        [np.sqrt(np.sum(np.square([pose.type_a for pose in group]), axis=0)) / len(group) for group in groups]
    )
    return mean, type_a


def find_extremes(poses: tuple[Pose, ...]) -> FaceExtremes:
    """Return offset and scale factor of each axis from its largest and smallest mean (Łuczak et al. 2022, eq. 4 to 9)."""
    mean, type_a = face_means(poses)
    axes = np.arange(3)
    highest, lowest = mean.argmax(axis=0), mean.argmin(axis=0)
    top, bottom = mean[highest, axes], mean[lowest, axes]
    return FaceExtremes(
        offset=(top + bottom) / 2,
        scale=(top - bottom) / 2,
        type_a=np.hypot(type_a[highest, axes], type_a[lowest, axes]) / 2,
    )


def apply_extremes(raw: Array, extremes: FaceExtremes) -> Array:
    """Return readings in g without a correction of misalignment (Łuczak et al. 2022, eq. 10 to 12), shape (..., 3)."""
    return np.asarray((raw - extremes.offset) / extremes.scale)


def pair_sensitivity(poses: tuple[Pose, ...]) -> Array:
    """Return half the difference of each pair of faces, shape (3, 3): row the axis that reads, column the axis of the pair."""
    mean, _ = face_means(poses)
    return np.asarray((mean[0::2] - mean[1::2]).T / 2)


def fit_six_positions(poses: tuple[Pose, ...], placement_u_deg: float = PLACEMENT_U_DEG) -> CalibrationFit:
    """Fit the affine model a_n = T S (a_m - b) (Zams and Łuczak 2024, eq. 1) by weighted least squares, with its covariance.

    `placement_u_deg` is the standard uncertainty of the angle between each face and the vertical, per direction: levelling of
    the surface, squareness of the housing. A pose tilted too far against its face is not used. Raises `NotDeterminedError` if a
    face is missing.
    """
    poses = without_tilted_poses(poses)
    used = tuple(pose for pose in poses if pose.used and pose.face is not None)
    extremes = find_extremes(used)
    placement_rad = np.radians(placement_u_deg)
    sensitivity = pair_sensitivity(used)
    readings = _face_readings(used, sensitivity, placement_rad)
    projections, parameters = _solve(readings)
    residual = readings.mean - _design_matrix(readings) @ parameters.T
    u_residual = _residual_u(readings, projections)
    warnings = find_outliers(used, np.abs(residual) / extremes.scale, u_residual / extremes.scale)
    is_checked = u_residual > MIN_CHECKED_SHARE * u_residual.max()
    ratio, freedom = float(np.mean((residual[is_checked] / u_residual[is_checked]) ** 2)), 3 * (len(used) - 4)
    if ratio > chi_square_quantile(CHANCE_LEVEL, freedom) / freedom:
        placement_rad *= np.sqrt(ratio)
        stated, assumed = f"{placement_u_deg:g} deg", f"{np.degrees(placement_rad):.2f} deg"
        text = f"the faces lay worse than the {stated} stated: {assumed} is reckoned with"
        warnings.append(FitWarning(text))
        readings = _face_readings(used, sensitivity, placement_rad)
    if len(poses) > len(used):
        text = f"{len(poses) - len(used)} poses lay on no face and were not used"
        warnings.append(FitWarning(text))
    return _affine_fit(poses, used, readings, projections, parameters, warnings)


def _face_readings(poses: tuple[Pose, ...], sensitivity: Array, placement_rad: float) -> _FaceReadings:
    up = np.array([FACE_DIRECTIONS[pose.face] for pose in poses if pose.face is not None])
    placement_g = np.where(up == 0, np.sin(placement_rad), np.sqrt(2) * placement_rad**2)  # of the vertical
    changes = np.zeros((len(poses), 3, len(poses), 3))
    for place, change_g in enumerate(placement_g):
        changes[place, :, place, :] = (sensitivity * change_g).T
    return _FaceReadings(
        mean=np.array([pose.mean for pose in poses]),
        up=up,
        noise_u=np.array([pose.type_a for pose in poses]),
        quantisation_u=np.array([pose.quantisation_u for pose in poses]),
        placement=changes.reshape(-1, len(poses), 3),
    )


def _design_matrix(readings: _FaceReadings) -> Array:
    return np.hstack([readings.up, np.ones((len(readings.up), 1))])


def _solve(readings: _FaceReadings) -> tuple[Array, Array]:
    """Solve the weighted least squares by axis: projections (3, 4, p) from means to parameters, and parameters (3, 4)."""
    design = _design_matrix(readings)
    weights = np.where(readings.up == 0, WEIGHT_ACROSS, 1.0)
    weighted = design.T * weights.T[:, None, :]
    projections = np.asarray(np.linalg.solve(weighted @ design, weighted))
    return projections, np.einsum("aip,pa->ai", projections, readings.mean)


def _residual_u(readings: _FaceReadings, projections: Array) -> Array:
    """Return the standard uncertainty of each residual, shape (p, 3); 0 where the fit passes through the reading."""
    remaining = np.eye(len(readings.up)) - _design_matrix(readings) @ projections
    return np.asarray(np.sqrt(np.einsum("apq,qa->pa", remaining**2, readings.variance)))


def _affine_fit(
    poses: tuple[Pose, ...],
    used: tuple[Pose, ...],
    readings: _FaceReadings,
    projections: Array,
    parameters: Array,
    warnings: list[FitWarning],
) -> CalibrationFit:
    sensitivity, offset = parameters[:, :3], parameters[:, 3]
    matrix = np.asarray(np.linalg.inv(sensitivity))
    noise, quantisation = _independent_changes(readings.noise_u), _independent_changes(readings.quantisation_u)
    contributions: tuple[Contribution, ...] = (
        Contribution("noise of the pose means", "A", _covariance(matrix, projections, noise)),
        Contribution("placement of the faces", "B", _covariance(matrix, projections, readings.placement)),
        Contribution("quantisation", "B", _covariance(matrix, projections, quantisation)),
    )
    if between := tuple(pose for pose in poses if pose.face is None):
        found = find_non_linearity(between, matrix, offset, total_covariance(contributions))
        contributions = (*contributions, non_linearity_contribution(found, matrix))
        if found.is_significant:
            text = f"non-linear between the faces: {found.describe()}; not corrected, in the budget"
            warnings.append(FitWarning(text))
    residual_g = (readings.mean - offset) @ matrix.T - readings.up
    return assemble_fit(
        PoseMethod.SIX_POSITION.value,
        matrix=matrix,
        offset=offset,
        sensitivity=pair_sensitivity(used),
        contributions=contributions,
        poses=poses,
        residual_rms_g=float(np.sqrt(np.mean(residual_g**2))),
        condition_number=float(np.linalg.cond(_design_matrix(readings))),
        warnings=warnings,
    )


def _independent_changes(u: Array) -> Array:
    """Return the changes of the means if each has a cause of its own, shape (3p, p, 3)."""
    return np.asarray(np.eye(u.size).reshape(u.size, *u.shape) * u)


def _covariance(matrix: Array, projections: Array, changes: Array) -> Array:
    """Return the covariance of matrix and offset from independent causes, whose changes of the means have shape (k, p, 3)."""
    by_axis = projections @ changes.transpose(2, 1, 0)  # (3, 4, k): of sensitivity rows and offset
    matrix_changes = -np.kron(matrix, matrix.T) @ by_axis[:, :3].reshape(9, -1)  # d(S^-1) = -S^-1 dS S^-1
    root = np.concatenate([matrix_changes, by_axis[:, 3]])
    return np.asarray(root @ root.T)
