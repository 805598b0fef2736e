"""Norm fit: |m| = 1 at rest in any attitude, so that no levelled surface is needed.

|m| does not change when all readings are turned together: nine parameters are determined, three are a convention. The matrix
is taken symmetric. That is the frame nearest to all three sensitive axes at once and prefers none of them, so that any axes
map serves; an upper triangular one would lay the whole of the misalignment on two axes. How this frame lies in the housing
stays unknown and is in the covariance as a rotation of type B; `zero` in place removes two of its three angles. Where an earlier
record knows the frame, it is kept: a recalibration must not turn the housing.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.methods.calibration_fit import CalibrationFit, assemble
from gateway.calibration.methods.experiment_design import conditioning, require_well_conditioned
from gateway.calibration.methods.misalignment import inverse
from gateway.calibration.methods.reference_frame import Frame, frame_of, nominal_frame, rotation_covariance
from gateway.calibration.poses.mean_uncertainty import quantisation_u
from gateway.calibration.poses.pose import Array, Pose
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.calibration.uncertainty import Contribution
from gateway.numerics.stats import chi_square_quantile

METHOD = "norm-fit"
FRAME_U_DEG = 0.58
"""Standard uncertainty of the frame's attitude in the housing per axis: 1 degree, rectangular (axis to package, 000 Table 9)."""
NEEDED = 9
STEPS = 50
SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Places of the six free entries."""


@dataclass(frozen=True, slots=True)
class _Solution:
    """Of the least squares in scaled readings: matrix near 1, offset in g."""

    matrix: Array
    offset: Array
    residual: Array
    """|m| - 1 per pose."""
    gradient: Array
    """Of each |m| by its scaled reading, shape (p, 3)."""
    projection: Array
    """From changes of |m| to the nine parameters, shape (9, p)."""


def fit_norm(
    poses: tuple[Pose, ...],
    units_per_g: float,
    frame_u_deg: float = FRAME_U_DEG,
    parent: CalibrationRecord | None = None,
) -> CalibrationFit:
    """Gauss-Newton on |M (raw - offset)| = 1, weighted by the noise along each pose's vertical.

    `units_per_g` is the nominal sensitivity, to within 30 %. The frame is that of `parent` where there is one. Raises
    `NotDeterminedError` where the poses are too few or too alike, naming what they leave open and which pose would help.
    """
    used = tuple(pose for pose in poses if pose.used)
    if len(used) < NEEDED:
        raise NotDeterminedError(
            f"{len(used)} poses for {NEEDED} unknowns; take {NEEDED - len(used)} more, each turned by 30 degrees or more"
        )
    mean = np.array([pose.mean for pose in used])
    u = _pose_u(used)
    centre, radius = _sphere(mean, units_per_g)
    up = (mean - centre) / np.linalg.norm(mean - centre, axis=1, keepdims=True)
    require_well_conditioned(up)
    solution = _solve((mean - centre) / radius, u / radius)
    symmetric = solution.matrix / radius
    frame = nominal_frame(frame_u_deg) if parent is None else frame_of(parent, symmetric)
    matrix = np.asarray(frame.rotation @ symmetric)
    offset = centre + solution.offset * radius
    warnings: list[str] = []
    excess = _excess(solution, u / radius, warnings)
    return assemble(
        METHOD,
        matrix=matrix,
        offset=offset,
        sensitivity=inverse(matrix),
        contributions=_contributions(used, solution, radius, excess, frame),
        poses=poses,
        residual_rms_g=float(np.sqrt(np.mean(solution.residual**2))),
        condition_number=conditioning(up),
        warnings=warnings,
    )


def _pose_u(poses: tuple[Pose, ...]) -> Array:
    """Standard uncertainty of each mean, noise and quantisation, shape (p, 3)."""
    return np.asarray(np.hypot([pose.type_a for pose in poses], _quantisation(poses)))


def _quantisation(poses: tuple[Pose, ...]) -> Array:
    noise = [pose.noise or tuple(u * np.sqrt(pose.count) for u in pose.type_a) for pose in poses]
    return np.array([quantisation_u(pose.step, np.array(sigma)) for pose, sigma in zip(poses, noise, strict=True)])


def _sphere(mean: Array, units_per_g: float) -> tuple[Array, float]:
    """Centre and radius of the sphere through the poses, by linear least squares: where the fit starts."""
    scaled = mean / units_per_g
    design = np.hstack([2 * scaled, np.ones((len(scaled), 1))])
    found, _, rank, _ = np.linalg.lstsq(design, (scaled**2).sum(axis=1), rcond=1e-6)
    if rank < 4:
        return np.zeros(3), units_per_g
    centre = found[:3]
    return centre * units_per_g, float(np.sqrt(found[3] + centre @ centre)) * units_per_g


def _solve(scaled: Array, u: Array) -> _Solution:
    parameters = np.concatenate([np.ones(3), np.zeros(6)])
    for _ in range(STEPS):
        matrix, offset = _symmetric(parameters), parameters[6:]
        up, residual, jacobian = _model(matrix, offset, scaled)
        gradient = up @ matrix
        weight = 1 / np.maximum(np.linalg.norm(gradient * u, axis=1), 1e-9)
        projection = np.linalg.pinv(jacobian * weight[:, None]) * weight
        step = projection @ residual
        parameters = parameters - step
        if np.max(np.abs(step)) < 1e-12:
            break
    else:
        raise NotDeterminedError(
            "the fit does not settle: a pose was moved, or the readings clip; take the poses again"
        )
    return _Solution(_symmetric(parameters), parameters[6:], residual, gradient, projection)


def _symmetric(parameters: Array) -> Array:
    xx, yy, zz, xy, xz, yz = parameters[:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _model(matrix: Array, offset: Array, scaled: Array) -> tuple[Array, Array, Array]:
    """Directions of the corrected readings (p, 3), |m| - 1 (p,), and its derivative by the nine parameters (p, 9)."""
    centred = scaled - offset
    corrected = centred @ matrix.T
    norm = np.linalg.norm(corrected, axis=1)
    up = corrected / norm[:, None]
    by_matrix = [up[:, i] * centred[:, j] + (up[:, j] * centred[:, i] if i != j else 0) for i, j in SYMMETRIC]
    return up, norm - 1, np.column_stack([*by_matrix, -up @ matrix])


def _excess(solution: _Solution, u: Array, warnings: list[str]) -> float:
    """By how much the residuals exceed what the noise explains, at least 1 (Birge); told in `warnings`."""
    freedom = len(u) - NEEDED
    if freedom < 1:
        warnings.append("nine poses for nine unknowns: nothing checks the fit; one more pose would")
        return 1.0
    chi_square = float(
        np.sum((solution.residual / np.maximum(np.linalg.norm(solution.gradient * u, axis=1), 1e-9)) ** 2)
    )
    if chi_square <= chi_square_quantile(0.99, freedom):
        return 1.0
    ratio = float(np.sqrt(chi_square / freedom))
    warnings.append(
        f"the norms scatter {ratio:.1f} times as much as the noise explains; the uncertainties are widened by it"
    )
    return ratio


def _contributions(
    poses: tuple[Pose, ...], solution: _Solution, radius: float, excess: float, frame: Frame
) -> tuple[Contribution, ...]:
    matrix = np.asarray(frame.rotation @ solution.matrix / radius)
    noise = solution.gradient * [pose.type_a for pose in poses] * excess / radius
    steps = solution.gradient * _quantisation(poses) / radius
    return (
        Contribution("noise of the pose means", "A", _covariance(solution, frame, noise, radius)),
        Contribution(frame.source, "B", rotation_covariance(matrix, frame.covariance_rad2)),
        Contribution("quantisation", "B", _covariance(solution, frame, steps, radius)),
    )


def _covariance(solution: _Solution, frame: Frame, u: Array, radius: float) -> Array:
    """Of matrix and offset in raw units, from the uncertainty of |m| that each axis brings, shape (p, 3)."""
    projected = solution.projection * np.linalg.norm(u, axis=1)
    spread = np.zeros((12, 9))
    for place, (i, j) in enumerate(SYMMETRIC):
        spread[3 * i + j, place] = spread[3 * j + i, place] = 1 / radius
    spread[9:, 6:] = radius * np.eye(3)
    root = spread @ projected
    root[:9] = np.kron(frame.rotation, np.eye(3)) @ root[:9]
    return np.asarray(root @ root.T)
