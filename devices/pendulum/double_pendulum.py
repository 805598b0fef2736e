"""Small swings of a double pendulum: its two modes, and the hook block that gives a mode its frequency.

With the lengths L1 of the rope and L2 of the rigging, the hook's mass over the load's q = 1/R and the rates w of the modes,

    w^4 - g (1 + R) (1/L1 + 1/L2) w^2 + g^2 (1 + R)/(L1 L2) = 0

which is solved for w^2 or for R. From the hook's equation L1 n'' = g R m - g (1 + R) n follows the shape of a mode.
"""

import math
from dataclasses import dataclass
from typing import Any

from devices.pendulum.equations import Scalar

MIN_LOAD_RATIO = 1e-9
"""Smallest load over hook, and smallest divisor, for which slopes are computed. Basis: no hook is so heavy that a mode needs
less."""


@dataclass(frozen=True, slots=True)
class Mode:
    """One of the two modes."""

    rate: Scalar
    """Angular frequency, in rad/s."""
    rigging_tilt: Scalar
    """Tilt of the rigging for a unit tilt of the rope."""


def modes(upper_m: Any, lower_m: Any, hook_mass_ratio: Any, gravity_m_s2: Any) -> tuple[Mode, Mode]:
    """Return the slow and the fast mode of a rope of `upper_m` and rigging of `lower_m`; numbers, arrays or symbols."""
    load_ratio = 1 / hook_mass_ratio
    both = (1 + load_ratio) * (1 / upper_m + 1 / lower_m)
    root = (both * both - 4 * (1 + load_ratio) / (upper_m * lower_m)) ** 0.5
    slow, fast = gravity_m_s2 / 2 * (both - root), gravity_m_s2 / 2 * (both + root)
    first, second = (
        Mode(square**0.5, (gravity_m_s2 * (1 + load_ratio) - upper_m * square) / (gravity_m_s2 * load_ratio))
        for square in (slow, fast)
    )
    return first, second


def hook_mass_ratio(upper_m: float, lower_m: float, fast_rate_1_s: float, gravity_m_s2: float) -> float:
    """Return the hook's mass over the load's that gives the fast mode this rate; infinite where every mode is faster."""
    if fast_rate_1_s**2 <= gravity_m_s2 / min(upper_m, lower_m):
        return math.inf
    total_ratio = _total_mass_ratio(upper_m, lower_m, fast_rate_1_s, gravity_m_s2)
    return 1 / max(total_ratio - 1, MIN_LOAD_RATIO)


def hook_mass_ratio_slopes(
    upper_m: float, lower_m: float, fast_rate_1_s: float, gravity_m_s2: float
) -> tuple[float, float]:
    """Return the derivatives of `hook_mass_ratio` by the rigging's length, both lengths' sum being fixed, and by the rate."""
    inverse_sum, inverse_product = 1 / upper_m + 1 / lower_m, 1 / (upper_m * lower_m)
    square = fast_rate_1_s**2
    total_ratio = _total_mass_ratio(upper_m, lower_m, fast_rate_1_s, gravity_m_s2)
    divisor = _divisor(upper_m, lower_m, square, gravity_m_s2)
    sum_slope = 1 / upper_m**2 - 1 / lower_m**2
    product_slope = inverse_product * (1 / upper_m - 1 / lower_m)
    by_total = -1 / max(total_ratio - 1, MIN_LOAD_RATIO) ** 2
    by_lower = -(gravity_m_s2 * square * sum_slope - gravity_m_s2**2 * product_slope) / divisor
    by_rate = 4 / fast_rate_1_s - 2 * gravity_m_s2 * fast_rate_1_s * inverse_sum / divisor
    return by_total * total_ratio * by_lower, by_total * total_ratio * by_rate


def _total_mass_ratio(upper_m: float, lower_m: float, rate_1_s: float, gravity_m_s2: float) -> float:
    """Return 1 + R, the mass of hook and load over that of the hook."""
    return rate_1_s**4 / _divisor(upper_m, lower_m, rate_1_s**2, gravity_m_s2)


def _divisor(upper_m: float, lower_m: float, rate_squared: float, gravity_m_s2: float) -> float:
    exact = gravity_m_s2 * rate_squared * (1 / upper_m + 1 / lower_m) - gravity_m_s2**2 / (upper_m * lower_m)
    return max(exact, MIN_LOAD_RATIO)
