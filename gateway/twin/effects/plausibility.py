"""Plausibility of parameters: what a part or a mount can have, as a prior of the evidence.

A deviation is as probable as any other up to the limit that data sheets state (a rectangular distribution, GUM 4.3.7). Beyond
it the density falls as that of a normal distribution, since parts break and clamps slip: an effect that needs such a value
loses against one that explains the data nearly as well without it.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Parameter, ParameterKind, Value

TAIL_SHARE = 0.25
"""Standard deviation of the density beyond the usual limit over that limit. Basis: at twice the limit odds of 3000 to 1."""


class StatedLimits(Protocol):
    """What a rig states of its sensor; None where it states nothing."""

    @property
    def offset_limit_g(self) -> float | None:
        """Largest zero-g offset."""

    @property
    def scale_limit(self) -> float | None:
        """Largest scale-factor error."""


def limit_of(parameter: Parameter, stated: StatedLimits) -> float | None:
    """Return the largest deviation from the neutral value that the sensor or its mount can have; None for no limit."""
    by_rig = {"offset_limit_g": stated.offset_limit_g, "scale_limit": stated.scale_limit}.get(parameter.limit_of_rig)
    return parameter.limit if by_rig is None else by_rig


def implausibility(effects: Mapping[str, Mapping[str, Value]], stated: StatedLimits) -> float:
    """Return minus twice the logarithm of the prior density, 0 where all values are within their limits; it adds to a BIC."""
    total = 0.0
    for name, values in effects.items():
        for parameter in EFFECTS[name].parameters:
            if parameter.limit is not None and parameter.name in values:
                beyond = excess(parameter, values[parameter.name], stated)
                total += float((beyond**2).sum()) / (TAIL_SHARE * parameter.limit) ** 2
    return total


def excess(parameter: Parameter, value: Value, stated: StatedLimits) -> NDArray[np.float64]:
    """Return by how much each component exceeds the limit, 0 where it does not."""
    limit = limit_of(parameter, stated)
    size = np.abs(np.atleast_1d(np.asarray(value, dtype=np.float64)) - parameter.neutral)
    return np.zeros_like(size) if limit is None else np.maximum(size - limit, 0.0)


def rests_at_edge(parameter: Parameter, value: Value) -> bool:
    """Return whether a value rests at a bound where the effect does not vanish: the fit would go further.

    An event that begins at once has the sharpest edge that can be, and is none the worse for it.
    """
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    outside = (numbers <= parameter.lower) | (numbers >= parameter.upper)
    return parameter.kind is not ParameterKind.EDGE and bool((outside & (numbers != parameter.neutral)).any())
