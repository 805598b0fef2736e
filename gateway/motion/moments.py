"""Mean and covariance of the motion over all hypotheses."""

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES, PIVOT_SIGN
from gateway.motion.mixing import Mixture
from gateway.motion.state_vector import INPUT, N_STATES
from gateway.numerics.array import Array


def mixture_moments(mixture: Mixture) -> tuple[Array, Array]:
    """Return mean and covariance of the states, shapes (N_STATES,) and (N_STATES, N_STATES).

    INPUT is the acceleration of the pivot there, which is zero unless the crane drives.
    """
    weight, covariances = mixture.weight, mixture.covariance.reshape(N_HYPOTHESES, -1)
    states = mixture.state * _PIVOT_INPUT
    mean = weight @ states
    covariance: Array = (weight @ covariances).reshape(N_STATES, N_STATES)
    of_pivot = ((weight * PIVOT_SIGN) @ covariances).reshape(N_STATES, N_STATES)
    covariance[INPUT], covariance[:, INPUT] = of_pivot[INPUT], of_pivot[:, INPUT]
    deviation = states - mean
    covariance += (weight[:, None] * deviation).T @ deviation
    return mean, covariance


def _pivot_input() -> Array:
    factor = np.ones((N_HYPOTHESES, N_STATES))
    factor[:, INPUT] = PIVOT_SIGN[:, None]
    return factor


_PIVOT_INPUT = _pivot_input()
