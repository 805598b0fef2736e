"""Whether what lies beside a free swing was held or moved by a hand, and not by rope and crane.

On a rope that a crane carries, the transverse force u (less that of equilibrium, over 1 - rho) moves the load by
theta'' = -w0^2 u, and u - theta is the acceleration of the pivot over g (Łuczak et al. 2022, section 8, with a moving pivot).
Integrated from the end of a free swing, where theta = u, the readings themselves state the acceleration that a crane would have
needed. The factor 1 - rho is not known; without it that acceleration is too small, never too large.
"""

import numpy as np

from gateway.numerics.array import Array

MAX_PIVOT_ACCELERATION_G = 0.22
"""Acceleration of a pivot that is no crane's, over g. Basis: drives reach 0.06; what the integration adds reaches 0.20 on
simulated work of cranes, where a gust or drive begins unnoticed."""
REACH_PERIODS = 0.75
"""Time from the end of a free swing over which the force is integrated: an error of the equilibrium then counts eleven times."""
EQUILIBRIUM_PERIODS = 2.0
"""Part of the free swing next to its end whose mean is the equilibrium."""
SLOPE_PERIODS = 0.15
"""Part of the free swing next to its end that gives the first value and slope."""


def pivot_acceleration_g(swing_g: Array, beside_g: Array, period: float) -> float:
    """Return the largest acceleration of the pivot over g that explains what follows a free swing, times 1 - rho.

    Both of shape (n, 3), with the period in samples; what precedes a swing is judged with both reversed in time.
    """
    equilibrium_g = swing_g[-round(EQUILIBRIUM_PERIODS * period) :].mean(axis=0)
    up = equilibrium_g / np.linalg.norm(equilibrium_g)
    across = np.eye(3) - np.outer(up, up)
    near_g = (swing_g[-max(4, round(SLOPE_PERIODS * period)) :] - equilibrium_g) @ across
    force_g = (beside_g[: round(REACH_PERIODS * period)] - equilibrium_g) @ across
    if len(force_g) == 0:
        return 0.0
    slope, start = np.polyfit(np.arange(len(near_g)) - (len(near_g) - 1), near_g, min(2, len(near_g) - 2))[-2:]
    rate_squared = (2 * np.pi / period) ** 2
    forces = np.vstack([start, force_g])
    speed = np.vstack([slope, slope - rate_squared * np.cumsum((forces[1:] + forces[:-1]) / 2, axis=0)])
    angle = start + np.cumsum((speed[1:] + speed[:-1]) / 2, axis=0)
    return float(np.linalg.norm(force_g - angle, axis=1).max())
