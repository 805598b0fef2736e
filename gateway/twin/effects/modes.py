"""Small swings of a double pendulum: its two modes."""

from dataclasses import dataclass
from typing import Any

from devices.pendulum.equations import Scalar
from devices.pendulum.pendulum import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True, slots=True)
class Mode:
    """One of the two."""

    rate: Scalar
    """In rad/s."""
    rigging_tilt: Scalar
    """Of the rigging for a unit tilt of the rope."""


def modes(
    upper_m: Any, lower_m: Any, hook_mass_ratio: Any, gravity: float = STANDARD_GRAVITY_M_S2
) -> tuple[Mode, Mode]:
    """The slow and the fast mode of a rope of `upper_m` and rigging of `lower_m`; numbers, arrays or symbols.

    w^2 = (g/2)(b -+ sqrt(b^2 - 4 (1+R)/(L1 L2))), b = (1+R)(1/L1 + 1/L2), R = 1/hook_mass_ratio; from the hook's equation
    L1 n'' = g R m - g (1+R) n follows the shape.
    """
    load_ratio = 1 / hook_mass_ratio
    both = (1 + load_ratio) * (1 / upper_m + 1 / lower_m)
    root = (both * both - 4 * (1 + load_ratio) / (upper_m * lower_m)) ** 0.5
    slow, fast = gravity / 2 * (both - root), gravity / 2 * (both + root)
    first, second = (
        Mode(square**0.5, (gravity * (1 + load_ratio) - upper_m * square) / (gravity * load_ratio))
        for square in (slow, fast)
    )
    return first, second
