"""What a set of pose directions determines of the nine parameters of the norm fit, and which pose would help most.

At first order |m| changes by n.E.n - n.b for a symmetric matrix error E and an offset b: what is determined hangs on the
directions n alone.
"""

import numpy as np

from gateway.calibration.poses.faces import candidate_directions, direction_text
from gateway.calibration.poses.pose import Array
from gateway.calibration.record import NotDeterminedError

CONDITION_LIMIT = 30.0
"""Poses all round give 2 to 4."""
PRIOR = 1e-3
"""Information that is taken for granted, so that the first poses can be compared."""
NAMES = (
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


def design(up: Array) -> Array:
    """Derivative of |m| by the nine parameters, for unit vectors `up` of shape (p, 3); shape (p, 9)."""
    x, y, z = up.T
    return np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, -x, -y, -z])


def conditioning(up: Array) -> float:
    """Condition number of the design, infinite where something is not determined."""
    return float(np.linalg.cond(design(up)))


def worst_combination(up: Array) -> str:
    """The parameters of the combination that the directions determine least, named."""
    direction = np.linalg.svd(design(up), full_matrices=True)[2][-1]
    strong = np.abs(direction) > 0.5 * np.abs(direction).max()
    return ", ".join(name for name, found in zip(NAMES, strong, strict=True) if found)


def next_direction(up: Array) -> Array:
    """Where up should point next, of the 26 that can be told: what lessens the determinant of the covariance most (D-optimal).

    `up` are the unit vectors so far, shape (p, 3), p may be 0.
    """
    rows = design(up)
    information = rows.T @ rows + PRIOR * np.eye(9)
    candidates = candidate_directions()
    offered = design(candidates)
    gain = np.einsum("ci,ij,cj->c", offered, np.linalg.inv(information), offered)
    return np.asarray(candidates[int(np.argmax(gain))])


def require_well_conditioned(up: Array) -> None:
    """Raise `NotDeterminedError` naming what is open and the pose that would help, where the condition number is too large."""
    found = conditioning(up)
    if found > CONDITION_LIMIT:
        raise NotDeterminedError(
            f"the poses do not determine {worst_combination(up)} (condition number {found:.3g}, limit {CONDITION_LIMIT:g}); "
            f"add a pose with {direction_text(next_direction(up))}"
        )
