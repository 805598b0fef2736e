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
    square = fast_rate_1_s**2
    divisor = gravity_m_s2 * square * (1 / upper_m + 1 / lower_m) - gravity_m_s2**2 / (upper_m * lower_m)
    total_ratio = square**2 / max(divisor, MIN_LOAD_RATIO)  # of hook and load over the hook
    return 1 / max(total_ratio - 1, MIN_LOAD_RATIO)
