"""Non-linearity of the axes, from poses between the faces of a six-position calibration.

An axis that reads n + q n^2 + c n^3 for a specific force n within 1 g is calibrated at its two extremes, n = 1 and n = -1.
Between them it errs by q (n^2 - 1) + c (n^3 - n). The attitude of a pose between the faces is not known, its magnitude is:
|m| - 1 is the sum of these errors along the vertical. The placement of the faces, which the covariance of the calibration
contains, is the larger part of the uncertainty.
"""

from dataclasses import dataclass

import numpy as np

from gateway.calibration.calibration_fit import Contribution
from gateway.calibration.pose import Pose
from gateway.numerics.array import Array
from gateway.numerics.stats import CHANCE_LEVEL, chi_square_quantile

PRIOR_U_G = 0.010
"""Standard deviation of q and c before the poses, g: data sheets limit non-linearity to 0.1 to 0.5 % of 2 to 4 g."""
K_NAMED = 2.0
"""Standard uncertainties beyond which the non-linearity of an axis is named. Definition: about 95 % (GUM 6.3)."""


@dataclass(frozen=True, slots=True)
class NonLinearity:
    """Non-linearity of each axis by the poses between the faces."""

    quadratic_g: Array
    """q, g, shape (3,)."""
    u_quadratic_g: Array
    cubic_g: Array
    """c, g, shape (3,)."""
    u_cubic_g: Array
    is_significant: bool
    """Whether the magnitudes deviate from 1 g by more than the uncertainties of the calibration and of the poses explain."""

    def describe(self) -> str:
        """Return the axes and terms that the poses show, in mg."""
        terms = [
            f"{axis} {name} {value * 1000:+.1f} +- {u * 1000:.1f} mg"
            for name, values, us in (
                ("quadratic", self.quadratic_g, self.u_quadratic_g),
                ("cubic", self.cubic_g, self.u_cubic_g),
            )
            for axis, value, u in zip("xyz", values, us, strict=True)
            if abs(value) > K_NAMED * u
        ]
        return ", ".join(terms) or "on axes that the poses do not tell apart"


def find_non_linearity(poses: tuple[Pose, ...], matrix: Array, offset: Array, covariance: Array) -> NonLinearity:
    """Return the non-linearity by poses between the faces, of which there is one at least.

    `matrix`, shape (3, 3), and `offset`, shape (3,), with their covariance, shape (12, 12), are those of the calibration.
    """
    raw = np.array([pose.mean for pose in poses]) - offset
    corrected_g = raw @ matrix.T
    norm_g = np.linalg.norm(corrected_g, axis=1)
    up = corrected_g / norm_g[:, None]
    jacobian = np.hstack([np.einsum("pa,pb->pab", up, raw).reshape(-1, 9), -up @ matrix])
    u_mean = np.array([np.hypot(pose.type_a, pose.quantisation_u) for pose in poses])
    errors = jacobian @ covariance @ jacobian.T + np.diag((((up @ matrix) * u_mean) ** 2).sum(axis=1))
    residual_g = norm_g - 1
    chi_square = float(residual_g @ np.linalg.solve(errors, residual_g))
    design = np.hstack([up * (up**2 - 1), up * (up**3 - up)])
    gain = PRIOR_U_G**2 * np.linalg.solve(PRIOR_U_G**2 * design @ design.T + errors, design).T
    found = gain @ residual_g
    u_found = PRIOR_U_G * np.sqrt(np.clip(1 - np.einsum("kp,pk->k", gain, design), 0, None))
    return NonLinearity(
        quadratic_g=found[:3],
        u_quadratic_g=u_found[:3],
        cubic_g=found[3:],
        u_cubic_g=u_found[3:],
        is_significant=chi_square > chi_square_quantile(CHANCE_LEVEL, len(poses)),
    )


def non_linearity_contribution(found: NonLinearity, matrix: Array) -> Contribution:
    """Return the contribution of a non-linearity, which nothing corrects; zero where the poses show none.

    Near 0 g a quadratic term is an error of the offset, a cubic one an error of the scale factor.
    """
    covariance = np.zeros((12, 12))
    if found.is_significant:
        sensitivity = np.linalg.inv(matrix)
        covariance[9:, 9:] = (sensitivity * found.quadratic_g**2) @ sensitivity.T
        covariance[[0, 4, 8], [0, 4, 8]] = (found.cubic_g * np.diag(matrix)) ** 2
    return Contribution("non-linearity", "A", covariance)
