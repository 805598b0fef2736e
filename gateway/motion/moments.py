"""Mean and covariance of the motion over all hypotheses."""

from functools import cache

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES, PIVOT_SIGN
from gateway.motion.mixing import Mixture
from gateway.motion.state_vector import INPUT
from gateway.numerics.array import Array


def mixture_moments(mixture: Mixture) -> tuple[Array, Array]:
    """Return mean and covariance of the states, shapes (n,) and (n, n).

    INPUT is the acceleration of the pivot there, which is zero unless the crane drives.
    """
    weight, covariances = mixture.weight, mixture.covariance.reshape(N_HYPOTHESES, -1)
    n = mixture.state.shape[1]
    states = mixture.state * _pivot_input(n)
    mean = weight @ states
    covariance: Array = (weight @ covariances).reshape(n, n)
    of_pivot = ((weight * PIVOT_SIGN) @ covariances).reshape(n, n)
    covariance[INPUT], covariance[:, INPUT] = of_pivot[INPUT], of_pivot[:, INPUT]
    deviation = states - mean
    covariance += (weight[:, None] * deviation).T @ deviation
    return mean, covariance


def variance_along(covariance: list[list[float]], direction: complex) -> float:
    """Return the variance of a pair along a direction of length 0 or 1."""
    (xx, xy), (_, yy) = covariance
    x, y = direction.real, direction.imag
    return xx * x * x + 2 * xy * x * y + yy * y * y


@cache
def _pivot_input(n: int) -> Array:
    factor = np.ones((N_HYPOTHESES, n))
    factor[:, INPUT] = PIVOT_SIGN[:, None]
    return factor
