"""How the disturbances of each hypothesis change within a step: their decay and their noise, in closed form."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from gateway.motion.hypotheses import (
    HEAVE_SIGMA,
    N_HYPOTHESES,
    PIVOT_LEVEL,
    PIVOT_LEVELS,
    WINCH_LEVEL,
    WIND_LEVEL,
    WIND_LEVELS,
    PivotLevel,
    starts_1_s,
)
from gateway.numerics.array import Array

HOIST_JERK_SIGMA_M_S2, HOIST_JERK_RATE_1_S = 0.2, 0.5
"""Standard deviation and rate of a hoist's acceleration while its speed changes. Basis: 0.5 m/s reached in one to two seconds."""
SMALLEST_RATE_1_S = 1e-3
"""Rate of an acceleration that changes at once, over its standard deviation: it has none, but a variance must be positive."""
HOIST_MEMORY_S = 20.0
"""Time after which a changing speed is forgotten that no reading confirms."""
STILL_ACCELERATION_M_S2, STILL_RATE_1_S = 5e-4, 6.0
"""The same of a winch that rests or runs steadily: what is left of its acceleration."""
STILL_SPEED_WALK_M_S = 2e-3
"""Random walk of such a speed, m/s/sqrt(s): a rope that settles on its drum."""
RESTING_SPEED_TIME_S = 1.0
"""Time in which the speed of a winch that rests returns to zero: 1.4 mm/s are left. Basis: with 5 mm/s the speed takes up an
error of the damping, and the length goes with it."""


@dataclass(frozen=True, slots=True)
class DisturbanceStep:
    """The change within one step, for all hypotheses. Pairs of a value and its rate have 2 x 2 matrices.

    The equations of motion have carried a pair by its own rate before; `pivot`, `heave` and `hoist` replace that by the level's
    decay.
    """

    pivot: Array
    """Shape (m, 2, 2)."""
    pivot_noise: Array
    hoist: Array
    hoist_noise: Array
    gust: Array
    """Factor, shape (m,)."""
    gust_noise: Array
    heave: Array
    heave_noise: Array
    exchange: Array
    """Probability of each hypothesis (column) after each (row), shape (m, m)."""

    @classmethod
    def of(cls, time_s: float) -> Self:
        """Return the change within a time."""
        carried_back = np.array([[1.0, -time_s], [0.0, 1.0]])
        pivots = [_pivot(level, time_s) for level in PIVOT_LEVELS]
        heaves = [_heave(PIVOT_LEVELS[i], sigma, time_s) for i, sigma in zip(PIVOT_LEVEL, HEAVE_SIGMA, strict=True)]
        hoist, hoist_noise = _hoist(time_s)
        gust = np.exp([-level.rate_1_s * time_s for level in WIND_LEVELS])
        gust_noise = np.square([level.sigma for level in WIND_LEVELS]) * (1 - gust**2)
        exchange = starts_1_s() * time_s
        leaving = exchange.sum(axis=1)
        exchange *= (-np.expm1(-leaving) / leaving)[:, None]
        exchange[np.diag_indices(N_HYPOTHESES)] = np.exp(-leaving)
        return cls(
            pivot=(np.array([step for step, _ in pivots]) @ carried_back)[PIVOT_LEVEL],
            pivot_noise=np.array([noise for _, noise in pivots])[PIVOT_LEVEL],
            hoist=(hoist @ carried_back)[WINCH_LEVEL],
            hoist_noise=hoist_noise[WINCH_LEVEL],
            gust=gust[WIND_LEVEL],
            gust_noise=gust_noise[WIND_LEVEL],
            heave=np.array([step for step, _ in heaves]) @ carried_back,
            heave_noise=np.array([noise for _, noise in heaves]),
            exchange=exchange,
        )


def _oscillator(rate_1_s: float, damping_ratio: float, time_s: float) -> Array:
    """Return the transition of x'' = -2 z r x' - r^2 x, z at most 1."""
    decay = math.exp(-damping_ratio * rate_1_s * time_s)
    bare_1_s = rate_1_s * math.sqrt(1 - damping_ratio**2)
    sine = time_s if bare_1_s == 0 else math.sin(bare_1_s * time_s) / bare_1_s
    cosine, drag = math.cos(bare_1_s * time_s), damping_ratio * rate_1_s * sine
    return decay * np.array([[cosine + drag, sine], [-(rate_1_s**2) * sine, cosine - drag]])


def _stationary(step: Array, value_sigma: float, rate_sigma: float) -> tuple[Array, Array]:
    """Return a transition and the noise that keeps these standard deviations of the value and of its rate."""
    spread = np.diag([value_sigma**2, rate_sigma**2])
    return step, spread - step @ spread @ step.T


def _pivot(level: PivotLevel, time_s: float) -> tuple[Array, Array]:
    """Return transition and noise of the pivot's acceleration with its rate, shapes (2, 2)."""
    if level.is_abrupt:
        decay = np.diag([math.exp(-level.rate_1_s * time_s), 0.0])
        return _stationary(decay, level.sigma, SMALLEST_RATE_1_S * level.sigma)
    return _stationary(
        _oscillator(level.rate_1_s, level.damping_ratio, time_s), level.sigma, level.rate_1_s * level.sigma
    )


def _heave(level: PivotLevel, sigma: float, time_s: float) -> tuple[Array, Array]:
    """Return transition and noise of the pivot's vertical acceleration with its rate, shapes (2, 2)."""
    return _stationary(
        _oscillator(level.heave_rate_1_s, level.heave_damping, time_s), sigma, level.heave_rate_1_s * sigma
    )


def _hoist(time_s: float) -> tuple[Array, Array]:
    """Return transition and noise of the winch's speed and acceleration at each of its levels, shapes (3, 2, 2)."""
    rest = math.exp(-STILL_RATE_1_S * time_s)
    slow, fast = math.exp(-time_s / HOIST_MEMORY_S), math.exp(-HOIST_JERK_RATE_1_S * time_s)
    reached_s = (slow - fast) / (HOIST_JERK_RATE_1_S - 1 / HOIST_MEMORY_S)
    resting = [[math.exp(-time_s / RESTING_SPEED_TIME_S), time_s], [0.0, rest]]
    steady = [[1.0, time_s], [0.0, rest]]
    still_noise = np.diag([STILL_SPEED_WALK_M_S**2 * time_s, STILL_ACCELERATION_M_S2**2 * (1 - rest**2)])
    density = 2 * HOIST_JERK_RATE_1_S * HOIST_JERK_SIGMA_M_S2**2
    changing_noise = density * np.array([[time_s**3 / 3, time_s**2 / 2], [time_s**2 / 2, time_s]])
    steps = np.array([resting, steady, [[slow, reached_s], [0.0, fast]]])
    return steps, np.array([still_noise, still_noise, changing_noise])
