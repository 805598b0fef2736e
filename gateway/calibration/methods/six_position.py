"""Six positions: offset and scale of 000 eq. 4-12, and the full affine model with the covariance of what placed the faces.

The record's matrix is the affine one: an axis that is a few degrees off (cross-axis 2 % is 1.1 degrees) must not stay so.
Its off-diagonal entries are only as good as the faces were laid, and the covariance says so. Placement errs across the
vertical in the first order and along it in the second (eq. 3): so an axis' offset and scale come from its two extremes alone, as
in eq. 4-9, and its readings at the four other faces serve the off-diagonal entries and the check.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.methods.calibration_fit import OUTLIER, CalibrationFit, assemble
from gateway.calibration.methods.misalignment import inverse
from gateway.calibration.poses.faces import FACE_DIRECTIONS, FACES, direction_text
from gateway.calibration.poses.mean_uncertainty import quantisation_u
from gateway.calibration.poses.pose import Array, Face, Pose
from gateway.calibration.record import NotDeterminedError
from gateway.calibration.uncertainty import Contribution
from gateway.numerics.stats import chi_square_quantile

METHOD = "six-position"
PLACEMENT_U_DEG = 0.1
"""Standard uncertainty of a face's attitude per direction: a workshop's spirit level and a housing with dirt on its faces.
The source's machined cube on a levelled plate is ten times better."""
OUTLIER_SIGMA = 5.0
ACROSS_WEIGHT = 1e-6
"""Of a reading across the vertical against one along it: the limit in which placement errs far more than noise."""


@dataclass(frozen=True, slots=True)
class Extremes:
    """What the six extremes give (000 eq. 4-9), in raw units."""

    offset: Array
    scale: Array
    """Unit per g."""
    u_a: Array
    """Type A standard uncertainty of either, shape (3,)."""


@dataclass(frozen=True, slots=True)
class _Readings:
    """Poses as arrays; p poses, three axes."""

    mean: Array
    up: Array
    """Unit vectors, shape (p, 3)."""
    noise_u: Array
    quantisation_u: Array
    """Both in raw units, shape (p, 3)."""
    placement: Array
    """Change of the means with one standard uncertainty of each placement, shape (3p, p, 3): two directions across the
    vertical to the first order, and 1 - cos along it (000 eq. 3)."""

    @property
    def variance(self) -> Array:
        return np.asarray(self.noise_u**2 + self.quantisation_u**2 + (self.placement**2).sum(axis=0))


def missing_faces(poses: tuple[Pose, ...]) -> tuple[Face, ...]:
    """Faces of which no usable pose was taken."""
    seen = {pose.face for pose in poses if pose.used}
    return tuple(face for face in FACES if face not in seen)


def face_means(poses: tuple[Pose, ...]) -> tuple[Array, Array]:
    """Mean and type A standard uncertainty per face, repeats averaged, both of shape (6, 3) in the order of `FACES`.

    Raises `NotDeterminedError` naming the missing faces.
    """
    if missing := missing_faces(poses):
        lay = " then ".join(direction_text(FACE_DIRECTIONS[face]) for face in missing)
        raise NotDeterminedError(f"{_faces_text(missing)} missing: lay the sensor with {lay}")
    groups = [[pose for pose in poses if pose.used and pose.face == face] for face in FACES]
    mean = np.array([np.mean([pose.mean for pose in group], axis=0) for group in groups])
    type_a = np.array(
        [np.sqrt(np.sum(np.square([pose.type_a for pose in group]), axis=0)) / len(group) for group in groups]
    )
    return mean, type_a


def extremes(poses: tuple[Pose, ...]) -> Extremes:
    """Offset and scale factor of each axis from its largest and smallest mean (000 eq. 4-9)."""
    mean, type_a = face_means(poses)
    axes = np.arange(3)
    highest, lowest = mean.argmax(axis=0), mean.argmin(axis=0)
    top, bottom = mean[highest, axes], mean[lowest, axes]
    return Extremes((top + bottom) / 2, (top - bottom) / 2, np.hypot(type_a[highest, axes], type_a[lowest, axes]) / 2)


def relative(raw: Array, found: Extremes) -> Array:
    """Readings in g without the correction of misalignments (000 eq. 10-12), shape (..., 3)."""
    return np.asarray((raw - found.offset) / found.scale)


def pair_sensitivity(poses: tuple[Pose, ...]) -> Array:
    """Half the difference of each pair of faces, shape (3, 3): row the axis that reads, column the axis of the pair."""
    mean, _ = face_means(poses)
    return np.asarray((mean[0::2] - mean[1::2]).T / 2)


def fit_six_positions(poses: tuple[Pose, ...], placement_u_deg: float = PLACEMENT_U_DEG) -> CalibrationFit:
    """The affine model a_n = T S (a_m - b) (003 eq. 1) by weighted least squares, with its covariance.

    `placement_u_deg` is the standard uncertainty of each face's attitude against the vertical, per direction: levelling of
    the plate, squareness of the housing. Raises `NotDeterminedError` where a face is missing.
    """
    used = tuple(pose for pose in poses if pose.used and pose.face is not None)
    found = extremes(used)
    placement_rad = np.radians(placement_u_deg)
    sensitivity = pair_sensitivity(used)
    readings = _readings(used, sensitivity, placement_rad)
    projections, parameters = _solve(readings)
    residual = readings.mean - _design(readings) @ parameters.T
    u_residual = _residual_u(readings, projections)
    warnings = list(_outliers(used, np.abs(residual) / found.scale, u_residual / found.scale))
    checked = u_residual > 1e-3 * u_residual.max()  # where the fit goes through the reading, nothing is checked
    ratio, freedom = float(np.mean((residual[checked] / u_residual[checked]) ** 2)), 3 * (len(used) - 4)
    if ratio > chi_square_quantile(0.99, freedom) / freedom:
        placement_rad *= np.sqrt(ratio)
        warnings.append(
            f"the faces lay worse than the {placement_u_deg:g} deg stated: {np.degrees(placement_rad):.2f} deg is reckoned with"
        )
        readings = _readings(used, sensitivity, placement_rad)
    return _as_fit(poses, used, readings, projections, parameters, warnings)


def _readings(poses: tuple[Pose, ...], sensitivity: Array, placement_rad: float) -> _Readings:
    up = np.array([FACE_DIRECTIONS[pose.face] for pose in poses if pose.face is not None])
    noise = np.array([pose.noise or tuple(u * np.sqrt(pose.count) for u in pose.type_a) for pose in poses])
    lying = np.where(up == 0, np.sin(placement_rad), np.sqrt(2) * placement_rad**2)  # of the vertical, in g
    changes = np.zeros((len(poses), 3, len(poses), 3))
    for place, change_g in enumerate(lying):
        changes[place, :, place, :] = (sensitivity * change_g).T
    return _Readings(
        mean=np.array([pose.mean for pose in poses]),
        up=up,
        noise_u=np.array([pose.type_a for pose in poses]),
        quantisation_u=np.array([quantisation_u(pose.step, sigma) for pose, sigma in zip(poses, noise, strict=True)]),
        placement=changes.reshape(-1, len(poses), 3),
    )


def _design(readings: _Readings) -> Array:
    return np.hstack([readings.up, np.ones((len(readings.up), 1))])


def _solve(readings: _Readings) -> tuple[Array, Array]:
    """Weighted least squares, axis by axis: projections (3, 4, p) from means to parameters, and parameters (3, 4)."""
    design = _design(readings)
    weights = np.where(readings.up == 0, ACROSS_WEIGHT, 1.0)
    weighted = design.T * weights.T[:, None, :]
    projections = np.asarray(np.linalg.solve(weighted @ design, weighted))
    return projections, np.einsum("aip,pa->ai", projections, readings.mean)


def _residual_u(readings: _Readings, projections: Array) -> Array:
    """Standard uncertainty of each residual, shape (p, 3): 0 where the fit goes through the reading."""
    left = np.eye(len(readings.up)) - _design(readings) @ projections
    return np.asarray(np.sqrt(np.einsum("apq,qa->pa", left**2, readings.variance)))


def _as_fit(
    poses: tuple[Pose, ...],
    used: tuple[Pose, ...],
    readings: _Readings,
    projections: Array,
    parameters: Array,
    warnings: list[str],
) -> CalibrationFit:
    sensitivity, offset = parameters[:, :3], parameters[:, 3]
    matrix = inverse(sensitivity)
    contributions = (
        Contribution("noise of the pose means", "A", _covariance(matrix, projections, _independent(readings.noise_u))),
        Contribution("placement of the faces", "B", _covariance(matrix, projections, readings.placement)),
        Contribution("quantisation", "B", _covariance(matrix, projections, _independent(readings.quantisation_u))),
    )
    residual_g = (readings.mean - offset) @ matrix.T - readings.up
    if len(poses) > len(used):
        warnings.append(f"{len(poses) - len(used)} poses lay on no face and were not used")
    return assemble(
        METHOD,
        matrix=matrix,
        offset=offset,
        sensitivity=pair_sensitivity(used),
        contributions=contributions,
        poses=poses,
        residual_rms_g=float(np.sqrt(np.mean(residual_g**2))),
        condition_number=float(np.linalg.cond(_design(readings))),
        warnings=warnings,
    )


def _independent(u: Array) -> Array:
    """Changes of the means where each has its own cause, shape (3p, p, 3)."""
    return np.asarray(np.eye(u.size).reshape(u.size, *u.shape) * u)


def _covariance(matrix: Array, projections: Array, changes: Array) -> Array:
    """Of matrix and offset, from independent causes with their changes of the means, shape (k, p, 3)."""
    by_axis = projections @ changes.transpose(2, 1, 0)  # (3, 4, k): of sensitivity rows and offset
    root = np.concatenate([-np.kron(matrix, matrix.T) @ by_axis[:, :3].reshape(9, -1), by_axis[:, 3]])  # of the inverse
    return np.asarray(root @ root.T)


def _outliers(poses: tuple[Pose, ...], residual_g: Array, u_g: Array) -> list[str]:
    """Readings that stand further off the fit than the placement explains; a pair shares its residual."""
    faces: dict[str, list[str]] = {}
    for place, axis in np.argwhere(residual_g > np.maximum(OUTLIER_SIGMA * u_g, 1e-6)):
        text = f"U_{'xyz'[axis]} stands {residual_g[place, axis] * 1000:.1f} mg off the other positions"
        faces.setdefault(text, []).append(str(poses[place].face))
    return [f"{OUTLIER} {text} with {' or '.join(found)} up; lay that face again" for text, found in faces.items()]


def _faces_text(faces: tuple[Face, ...]) -> str:
    return f"face{'s' if len(faces) > 1 else ''} {', '.join(faces)}"
