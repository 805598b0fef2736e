"""Parameters of effects: meaning, unit, bounds, prior and scale; and which values parts and mounts can have.

A deviation is as probable as any other up to the limit that data sheets state (a rectangular distribution, GUM 4.3.7). Beyond
it the density falls as that of a normal distribution, since parts break and clamps slip: an effect that needs such a value
loses against one that explains the data nearly as well without it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar

Value = float | tuple[float, ...]
"""Value of a parameter: a number, or one number for each component."""
Values = Mapping[str, Value]
"""Parameters of one effect by name."""
Symbols = Mapping[str, Scalar]
"""Symbols of the parameters of one effect by name."""


NEGLIGIBLE = 1e-9
"""Size below which a value of any unit is printed as 0. Definition: what a fit leaves of an axis that was not measured."""
SMALL_SHARE = 0.01
"""What an operator would call small over what is typical. Basis: a choice; what changes so little is linear."""
TAIL_SHARE = 0.25
"""Standard deviation of the density beyond the usual limit over that limit. Basis: at twice the limit odds of 3000 to 1."""


class ParameterKind(Enum):
    """The role of a parameter in a fit."""

    AMPLITUDE = "amplitude"
    """The strength of the effect."""
    START = "start"
    """The time at which an event starts, in s since the first sample of the recording."""
    DURATION = "duration"
    """The duration of an event, or of a part of it, in s."""
    EDGE = "edge"
    """The fraction of an event in which it rises and falls."""
    FREQUENCY = "frequency"
    PHASE = "phase"
    CUTOFF = "cutoff"
    """A cutoff frequency. In the parameter vector it stands by its inverse, a lag, in which the samples are nearly linear."""


EVENT_TIME_KINDS = frozenset({ParameterKind.START, ParameterKind.DURATION, ParameterKind.EDGE})
"""Kinds that have no sensitivity while the amplitude of the event is zero."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect: one number, or several components of the same kind."""

    name: str
    unit: str
    meaning: str
    lower: float
    upper: float
    """Bounds of each component; a bound of 0 is a constraint on the sign."""
    neutral: float
    """The value at which the effect vanishes; for a parameter that does not make it vanish, an initial guess."""
    scale: float
    """A change that an operator would call small, in the parameter's unit."""
    typical: Value
    """The value that `simulate` takes if none is given."""
    components: tuple[str, ...] = ()
    """Names of the components; empty for a single number."""
    refitted: bool = False
    """True for a nuisance parameter, which belongs to a recording and not to the rig, such as the phase of a vibration."""
    kind: ParameterKind = ParameterKind.AMPLITUDE
    step_limit: float = math.inf
    """The largest change in one step of a fit: the range in which the samples are nearly linear in the parameter."""
    prior_sigma: float | None = None
    """Standard deviation of the nominal value, for a parameter that corrects a nominal length of the rig."""
    limit: float | None = None
    """Largest deviation from the neutral value that parts or mounts usually have, as data sheets state it; a larger one weighs
    against the effect (`plausibility`)."""
    limit_of_rig: str = ""
    """Field of the rig that replaces this limit where it is stated."""
    operator_sigma: float | None = None
    """Standard deviation of the value that an operator achieves by intention."""

    @property
    def size(self) -> int:
        """Number of components."""
        return max(1, len(self.components))

    @property
    def is_amplitude(self) -> bool:
        """Whether the parameter says how strong the effect is, and so has a signature while the effect is weak."""
        return self.kind is ParameterKind.AMPLITUDE and self.typical != self.neutral


def amplitude(
    name: str,
    unit: str,
    meaning: str,
    bounds: tuple[float, float],
    typical: Value,
    components: tuple[str, ...] = (),
    **further: Any,
) -> Parameter:
    """Return the parameter of a strength: the effect vanishes where it is 0. `further` are other fields of `Parameter`.

    A typical value that is one number is that of each component.
    """
    typical = typical if isinstance(typical, tuple) else (typical,) * len(components) or typical
    return Parameter(name, unit, meaning, *bounds, 0.0, _small(typical, bounds), typical, components, **further)


def shape(name: str, unit: str, meaning: str, bounds: tuple[float, float], neutral: float, **further: Any) -> Parameter:
    """Return a parameter that gives an effect its shape, such as a frequency; its typical value is the neutral one by default."""
    typical = further.pop("typical", neutral)
    scale = further.pop("scale", _small(typical, bounds))
    return Parameter(name, unit, meaning, *bounds, neutral, scale, typical, **further)


def frequency(meaning: str, bounds: tuple[float, float], neutral: float, **further: Any) -> Parameter:
    """Return the parameter `frequency_hz`."""
    return shape("frequency_hz", "Hz", meaning, bounds, neutral, kind=ParameterKind.FREQUENCY, **further)


def _small(typical: Value, bounds: tuple[float, float]) -> float:
    """Return a small part of what is typical, or of the range where that is 0."""
    return SMALL_SHARE * (float(np.max(np.abs(typical))) or bounds[1])


def without_rounding(value: float) -> float:
    """Return a value as it is printed: 0 where a fit leaves next to nothing."""
    return value if abs(value) > NEGLIGIBLE else 0.0


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
