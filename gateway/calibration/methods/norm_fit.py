"""Norm fit: |m| = 1 at rest in every attitude, so no levelled surface is needed.

A rotation of all readings changes no magnitude: nine parameters are determined and three are a convention. The matrix is taken
symmetric. This frame is the nearest to all three sensitive axes and prefers none of them, so every axes map can be used with
it; an upper triangular matrix would put the whole misalignment on two axes. The attitude of this frame in the housing stays
unknown; the covariance contains it as a rotation of type B, and zeroing in place removes two of its three angles. If an earlier
record knows the frame, it is kept: a recalibration must not turn the housing.

The reference frame, three angles that no magnitude shows, is that of the parent or of the sensor's assembly.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.calibration.calibration_fit import CalibrationFit, Contribution, FitWarning, assemble_fit
from gateway.calibration.methods.experiment_design import condition_number, require_well_conditioned
from gateway.calibration.pose import Pose
from gateway.calibration.record import CalibrationRecord, NotDeterminedError, PoseMethod
from gateway.numerics.array import Array
from gateway.numerics.stats import CHANCE_LEVEL, chi_square_quantile, student_quantile

FRAME_U_DEG = 0.58
"""Standard uncertainty of the frame's attitude in the housing about each axis, degrees.

1 degree between axes and package, rectangular (Łuczak et al. 2022, Table 9).
"""
N_PARAMETERS = 9
"""Definition: three offsets and the six free entries of a symmetric matrix."""
MAX_NORM_ITERATIONS = 50
"""Basis: a choice; usual fits need far fewer, and one that does not converge ends soon."""
CONVERGED_STEP = 1e-12
"""Largest step of a parameter, g or relative, at which the iteration has converged. Basis: a choice; above rounding (2e-16), and
below any uncertainty."""
MIN_U_G = 1e-9
"""Least uncertainty of a magnitude, g, so that readings without noise have a finite weight. Basis: a choice; above rounding, and
a hundred thousandth of the noise of a mean."""
MIN_OUTLIER_FREEDOM = 3
"""Least degrees of freedom at which an outlier is told. Basis: with two, the scatter of the others is that of one number."""
SINGULAR_SPHERE = 1e-6
"""Relative singular value below which the poses do not determine a sphere. Basis: a choice; above rounding, and poses of any use
are far from it."""
SYMMETRIC_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Rows and columns of the six free entries of the matrix."""


@dataclass(frozen=True, slots=True)
class ReferenceFrame:
    """Rotation of the symmetric matrix of a norm fit into the sensor's axes."""

    source: str
    """Origin of the frame, as the uncertainty budget names it."""
    rotation: Array
    """Rotation matrix, shape (3, 3)."""
    covariance_rad2: Array
    """Covariance of the rotation's angles about the three axes, shape (3, 3)."""


def nominal_frame(u_deg: float) -> ReferenceFrame:
    """Return the symmetric frame itself, with this standard uncertainty about each axis."""
    return ReferenceFrame("attitude of the frame in the housing", np.eye(3), np.radians(u_deg) ** 2 * np.eye(3))


def parent_frame(parent: CalibrationRecord, symmetric: Array) -> ReferenceFrame:
    """Return the frame of a parent record: the rotation that brings the symmetric matrix nearest to the parent's matrix."""
    matrix = np.array(parent.correction_matrix, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix @ np.linalg.inv(symmetric))
    relative_error_jacobian = np.kron(np.eye(3), np.linalg.inv(matrix).T)  # (1 + E) M: E by the entries of M
    angle_jacobian = np.array([_skew(axis).ravel() / 2 for axis in np.eye(3)]) @ relative_error_jacobian
    covariance = np.array(parent.covariance, dtype=np.float64)[:9, :9]
    return ReferenceFrame(
        source=f"attitude of the frame, as of record {parent.id}",
        rotation=np.asarray(left @ right),
        covariance_rad2=angle_jacobian @ covariance @ angle_jacobian.T,
    )


def rotation_covariance(matrix: Array, covariance_rad2: Array) -> Array:
    """Return the covariance that small rotations of a correction matrix with this covariance cause, shape (12, 12)."""
    jacobian = np.zeros((12, 3))
    jacobian[:9] = np.column_stack([(_skew(axis) @ matrix).ravel() for axis in np.eye(3)])
    return np.asarray(jacobian @ covariance_rad2 @ jacobian.T)


def _skew(vector: Array) -> Array:
    """Return the matrix of the cross product `vector` x ..., shape (3, 3)."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@dataclass(frozen=True, slots=True)
class _Solution:
    """Solution of the least squares in scaled readings, with a matrix near 1 and an offset in g."""

    matrix: Array
    offset: Array
    residual: Array
    """|m| - 1 of each pose, shape (p,)."""
    gradient: Array
    """Derivative of each |m| by its scaled reading, shape (p, 3)."""
    projection: Array
    """Derivative of the nine parameters by each |m|, shape (9, p)."""
    leverage: Array
    """Derivative of each fitted |m| by itself, shape (p,)."""


def fit_norm(
    poses: tuple[Pose, ...],
    units_per_g: float,
    frame_u_deg: float = FRAME_U_DEG,
    parent: CalibrationRecord | None = None,
) -> CalibrationFit:
    """Fit |M (raw - offset)| = 1 by Gauss-Newton, weighted by the noise along the vertical of each pose, without outliers.

    `units_per_g` is the nominal sensitivity, to within 30 %. The frame is that of `parent` if there is one. Raises
    `NotDeterminedError` if the poses are too few or too alike, with the undetermined parameters and the pose that would help.
    """
    used = tuple(pose for pose in poses if pose.used)
    if len(used) < N_PARAMETERS:
        raise NotDeterminedError(
            f"{len(used)} poses for {N_PARAMETERS} unknowns; "
            f"take {N_PARAMETERS - len(used)} more, each turned by 30 degrees or more"
        )
    mean = np.array([pose.mean for pose in used])
    u = np.array([np.hypot(pose.type_a, pose.quantisation_u) for pose in used])
    centre, radius = _fit_sphere(mean, units_per_g)
    up = (mean - centre) / np.linalg.norm(mean - centre, axis=1, keepdims=True)
    require_well_conditioned(up)
    solution = _solve((mean - centre) / radius, u / radius)
    if (outlier := _find_outlier(solution, u / radius)) is not None:
        place = poses.index(used[outlier])
        fewer = (*poses[:place], replace(poses[place], used=False), *poses[place + 1 :])
        fit = fit_norm(fewer, units_per_g, frame_u_deg, parent)
        return replace(fit, warnings=(_outlier_warning(place, solution.residual[outlier]), *fit.warnings))
    symmetric = solution.matrix / radius
    frame = nominal_frame(frame_u_deg) if parent is None else parent_frame(parent, symmetric)
    matrix = np.asarray(frame.rotation @ symmetric)
    offset = centre + solution.offset * radius
    scatter_ratio, warnings = _check_scatter(solution, u / radius)
    return assemble_fit(
        PoseMethod.NORM_FIT.value,
        matrix=matrix,
        offset=offset,
        sensitivity=np.asarray(np.linalg.inv(matrix), dtype=np.float64),
        contributions=_contributions(used, solution, radius, scatter_ratio, frame),
        poses=poses,
        residual_rms_g=float(np.sqrt(np.mean(solution.residual**2))),
        condition_number=condition_number(up),
        warnings=warnings,
    )


def _fit_sphere(mean: Array, units_per_g: float) -> tuple[Array, float]:
    """Return centre and radius of the sphere through the poses by linear least squares, the initial guess of the fit."""
    scaled = mean / units_per_g
    design = np.hstack([2 * scaled, np.ones((len(scaled), 1))])
    found, _, rank, _ = np.linalg.lstsq(design, (scaled**2).sum(axis=1), rcond=SINGULAR_SPHERE)
    if rank < 4:
        return np.zeros(3), units_per_g
    centre = found[:3]
    return centre * units_per_g, float(np.sqrt(found[3] + centre @ centre)) * units_per_g


def _solve(scaled: Array, u: Array) -> _Solution:
    parameters = np.concatenate([np.ones(3), np.zeros(6)])
    for _ in range(MAX_NORM_ITERATIONS):
        matrix, offset = _symmetric_matrix(parameters), parameters[6:]
        up, residual, jacobian = _evaluate_model(matrix, offset, scaled)
        gradient = up @ matrix
        weight = 1 / np.maximum(np.linalg.norm(gradient * u, axis=1), MIN_U_G)
        projection = np.linalg.pinv(jacobian * weight[:, None]) * weight
        step = projection @ residual
        parameters = parameters - step
        if np.max(np.abs(step)) < CONVERGED_STEP:
            break
    else:
        raise NotDeterminedError(
            "the fit does not converge: the sensor was moved in a pose, or the readings clip; take the poses again"
        )
    leverage = np.einsum("pi,ip->p", jacobian, projection)
    return _Solution(_symmetric_matrix(parameters), parameters[6:], residual, gradient, projection, leverage)


def _symmetric_matrix(parameters: Array) -> Array:
    xx, yy, zz, xy, xz, yz = parameters[:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _evaluate_model(matrix: Array, offset: Array, scaled: Array) -> tuple[Array, Array, Array]:
    """Return directions of the corrected readings (p, 3), |m| - 1 (p,), and its derivatives by the nine parameters (p, 9)."""
    centred = scaled - offset
    corrected = centred @ matrix.T
    norm = np.linalg.norm(corrected, axis=1)
    up = corrected / norm[:, None]
    matrix_columns = [
        up[:, i] * centred[:, j] + (up[:, j] * centred[:, i] if i != j else 0) for i, j in SYMMETRIC_ENTRIES
    ]
    return up, norm - 1, np.column_stack([*matrix_columns, -up @ matrix])


def _find_outlier(solution: _Solution, u: Array) -> int | None:
    """Return the pose that deviates from all others by more than they scatter among themselves, None without one.

    The residual over the scatter without that pose follows Student's t, the largest of p by p times the probability (Bonferroni).
    """
    freedom = len(u) - N_PARAMETERS
    if freedom < MIN_OUTLIER_FREEDOM:
        return None
    norm_u = np.maximum(np.linalg.norm(solution.gradient * u, axis=1), MIN_U_G)
    chi_square = float(np.sum((solution.residual / norm_u) ** 2))
    if chi_square <= chi_square_quantile(CHANCE_LEVEL, freedom):
        return None
    deviation = (solution.residual / norm_u) ** 2 / np.maximum(1 - solution.leverage, MIN_U_G)
    worst = int(np.argmax(deviation))
    others = max((chi_square - float(deviation[worst])) / (freedom - 1), 1.0)
    limit = student_quantile(1 - (1 - CHANCE_LEVEL) / 2 / len(u), freedom - 1)
    return worst if deviation[worst] > limit**2 * others else None


def _outlier_warning(place: int, residual_g: float) -> FitWarning:
    off = f"pose {place + 1} reads {1000 * residual_g:+.1f} mg off |m| = 1 of the others"
    return FitWarning(f"{off}: not used; it moved, or is of another part", is_outlier=True)


def _check_scatter(solution: _Solution, u: Array) -> tuple[float, list[FitWarning]]:
    """Return the Birge ratio, the scatter of the residuals over that of the noise, at least 1, and warnings about it."""
    freedom = len(u) - N_PARAMETERS
    if freedom < 1:
        text = "nine poses for nine unknowns: nothing checks the fit; one more pose would"
        return 1.0, [FitWarning(text)]
    norm_u = np.maximum(np.linalg.norm(solution.gradient * u, axis=1), MIN_U_G)
    chi_square = float(np.sum((solution.residual / norm_u) ** 2))
    if chi_square <= chi_square_quantile(CHANCE_LEVEL, freedom):
        return 1.0, []
    ratio = float(np.sqrt(chi_square / freedom))
    text = f"the norms scatter {ratio:.1f} times as much as the noise explains; the uncertainties are widened by it"
    return ratio, [FitWarning(text)]


def _contributions(
    poses: tuple[Pose, ...], solution: _Solution, radius: float, scatter_ratio: float, frame: ReferenceFrame
) -> tuple[Contribution, ...]:
    matrix = np.asarray(frame.rotation @ solution.matrix / radius)
    noise_u = solution.gradient * [pose.type_a for pose in poses] * scatter_ratio / radius
    steps_u = solution.gradient * [pose.quantisation_u for pose in poses] / radius
    return (
        Contribution("noise of the pose means", "A", _covariance(solution, frame, noise_u, radius)),
        Contribution(frame.source, "B", rotation_covariance(matrix, frame.covariance_rad2)),
        Contribution("quantisation", "B", _covariance(solution, frame, steps_u, radius)),
    )


def _covariance(solution: _Solution, frame: ReferenceFrame, u: Array, radius: float) -> Array:
    """Return the covariance of matrix and offset in raw units, from the uncertainty of |m| by axis, shape (p, 3)."""
    projected = solution.projection * np.linalg.norm(u, axis=1)
    unscaling = np.zeros((12, 9))
    for place, (i, j) in enumerate(SYMMETRIC_ENTRIES):
        unscaling[3 * i + j, place] = unscaling[3 * j + i, place] = 1 / radius
    unscaling[9:, 6:] = radius * np.eye(3)
    root = unscaling @ projected
    root[:9] = np.kron(frame.rotation, np.eye(3)) @ root[:9]
    return np.asarray(root @ root.T)
