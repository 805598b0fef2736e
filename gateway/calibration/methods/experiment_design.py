"""Experiment design of the norm fit: which of its nine parameters a set of poses determines, and which pose would help most.

To first order |m| changes by n.E.n - n.b for a symmetric matrix error E and an offset b, so the directions n alone decide what is
determined.
"""

import numpy as np

from gateway.calibration.calibration_fit import MAX_CONDITION_NUMBER
from gateway.calibration.pose import candidate_directions, describe_direction
from gateway.calibration.record import NotDeterminedError
from gateway.numerics.array import Array

PRIOR_INFORMATION = 1e-3
"""Information on each parameter that is assumed before the first pose, so that few poses can be compared. Basis: a choice; far
below the information of one pose, far above rounding."""
PARAMETER_NAMES = (
    "scale x",
    "scale y",
    "scale z",
    "cross-axis xy",
    "cross-axis xz",
    "cross-axis yz",
    "offset x",
    "offset y",
    "offset z",
)
NAMED_SHARE = 0.5
"""Least component of an undetermined combination, relative to its largest one, that is named. Basis: a choice; a text that names
one to three parameters."""


def design_matrix(up: Array) -> Array:
    """Return the derivatives of |m| by the nine parameters for unit vectors `up`, (p, 3), to the vertical; shape (p, 9)."""
    x, y, z = up.T
    return np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, -x, -y, -z])


def condition_number(up: Array) -> float:
    """Return the condition number of the design matrix, infinite if a parameter is undetermined."""
    return float(np.linalg.cond(design_matrix(up)))


def worst_combination(up: Array) -> str:
    """Return the names of the parameters in the combination that the directions determine least."""
    combination = np.linalg.svd(design_matrix(up), full_matrices=True)[2][-1]
    is_strong = np.abs(combination) > NAMED_SHARE * np.abs(combination).max()
    return ", ".join(name for name, strong in zip(PARAMETER_NAMES, is_strong, strict=True) if strong)


def next_direction(up: Array) -> Array:
    """Return the direction of 26 that reduces the determinant of the covariance most (D-optimal design).

    `up` are the unit vectors of the poses so far, shape (p, 3); p may be 0.
    """
    rows = design_matrix(up)
    information = rows.T @ rows + PRIOR_INFORMATION * np.eye(9)
    candidates = candidate_directions()
    candidate_rows = design_matrix(candidates)
    gain = np.einsum("ci,ij,cj->c", candidate_rows, np.linalg.inv(information), candidate_rows)
    return np.asarray(candidates[int(np.argmax(gain))])


def require_well_conditioned(up: Array) -> None:
    """Raise `NotDeterminedError` if the condition number is too large, with the parameters and the pose that would help."""
    found = condition_number(up)
    if found > MAX_CONDITION_NUMBER:
        raise NotDeterminedError(
            f"the poses do not determine {worst_combination(up)} "
            f"(condition number {found:.3g}, limit {MAX_CONDITION_NUMBER:g}); "
            f"add a pose with {describe_direction(next_direction(up))}"
        )
