"""What crane and load do, by the probabilities of the hypotheses and the size of the motion."""

import numpy as np

from gateway.motion.estimate import MotionState
from gateway.motion.hypotheses import probabilities
from gateway.numerics.array import Array

REST_RAD = np.radians(0.15)
"""Amplitude below which a load rests."""
LARGEST_REST_RAD = np.radians(1.0)
"""Amplitude from which on a load is not said to rest, however uncertain it is. Basis: what an operator sees."""
SIGNIFICANT = 3.0
"""Standard uncertainties."""
SLOWEST_HOIST_M_S = 0.02
LIKELY = 0.5
"""Definition: the more probable of two."""


def motion_state(
    weight: Array, amplitude: float, u_amplitude: float, speed_m_s: float, speed_u_m_s: float
) -> MotionState:
    """Return the state; `amplitude` of the swing, rad, and `speed_m_s` of the hoist with their standard uncertainties."""
    driven, gust, hoisting = probabilities(weight)
    if driven > LIKELY:
        return "driven"
    if hoisting > LIKELY and abs(speed_m_s) > max(SIGNIFICANT * speed_u_m_s, SLOWEST_HOIST_M_S):
        return "hoisting"
    if gust > LIKELY:
        return "wind"
    return "rest" if amplitude < max(REST_RAD, min(SIGNIFICANT * u_amplitude, LARGEST_REST_RAD)) else "free"
