"""What a reconciliation estimates: the parameters of effects, the law of what no effect explains, and what is left of the motion.

A cause outside the vocabulary shows by what is left. A reading that is not linear in what it measures leaves lines at multiples
of the swing's frequency along the swing; a second support or a tilted axis leaves them across it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from gateway.twin.effects.parameter import Value

Direction = Literal["along the swing", "across the swing", "along the rope"]
DIRECTIONS: tuple[Direction, ...] = ("along the swing", "across the swing", "along the rope")
UNEQUAL = 1.5
"""Ratio of the shares in wide and small swings from which on both are told."""
MULTIPLES = ("", "twice ", "three times ", "four times ")
CAUSES: dict[tuple[Direction, int], str] = {
    ("along the swing", 1): "a length, a loss or a clock that changes with the amplitude or in time",
    (
        "along the swing",
        2,
    ): "a reading that is not linear (an angle sensor, the perspective of a camera), or a load that rocks",
    ("across the swing", 1): "a suspension that is stiffer to one side, or a swing that turns",
    ("across the swing", 2): "a second support, a tilted axis, or a sensor askew",
    ("along the rope", 1): "a housing askew on the rope, or a pivot that moves",
    ("along the rope", 2): "the housing's place, the scale of the axis along the rope, or a rope that stretches",
}
"""What is typical of a direction and a multiple of the swing's frequency, 2 standing for all from there on."""
SLOW_CAUSE = "a zero or a mount that drifts, or wind"
"""Of a line at less than half the swing's frequency."""
OTHER_CAUSE = "another body or a second mode, a machine, or wind"
"""Of a line at no multiple."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter of a named effect."""

    value: Value
    ci95: tuple[Value, Value]
    unit: str
    meaning: str
    plausible: bool
    """Inside its physical bounds, not resting on one, and within what a part or a mount can have."""
    limit: float | None = None
    """Largest size that a part or a mount can have; None where there is no such limit."""
    stated: Value | None = None
    """What the rig states; None where its model does not have the effect."""


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """An effect that the data hold."""

    name: str
    explains: str
    equation: str
    parameters: Mapping[str, Estimate]
    when_s: tuple[float, float] | None
    """When a transient effect acted."""

    @property
    def is_stated(self) -> bool:
        """Whether the rig's model has the effect, with other values."""
        return any(each.stated is not None for each in self.parameters.values())


@dataclass(frozen=True, slots=True)
class Resemblance:
    """An effect of the vocabulary beside a term of a law."""

    name: str
    cosine: float
    """Of the angle between the signatures, the initial motion projected out; 1 is the same signature."""
    reversed: bool
    """It would need a negative size, which it cannot have."""


@dataclass(frozen=True, slots=True)
class LawTerm:
    """A term of the law of what no effect explains."""

    name: str
    text: str
    """The term with numbers and units: `force/mass = +0.0042 1/s v`."""
    meaning: str
    """The same in an operator's words."""
    parameters: Mapping[str, Estimate]
    alternatives: tuple[str, ...]
    """Other terms that describe the data nearly as well, the closest first."""
    closest_effects: tuple[Resemblance, ...]
    """Effects of the vocabulary whose signature is the most similar."""


@dataclass(frozen=True, slots=True)
class Law:
    """What no effect of the vocabulary explains, as terms of an equation: a description, no cause."""

    terms: tuple[LawTerm, ...]
    beside: tuple[str, ...]
    """Effects of the vocabulary that are part of the same model."""
    closed_test_percent: float | None
    """Share of the gap on the test part that the law closes beside them."""

    @property
    def text(self) -> str:
        """All terms with their meanings."""
        return "; ".join(f"{term.text} ({term.meaning})" for term in self.terms)


@dataclass(frozen=True, slots=True)
class Remainder:
    """What is left of the motion in the log."""

    share: float
    """Rms of the residual over that of the readings about their mean, both without the noise."""
    share_before: float
    """The same by the nominal model."""
    share_wide_swing: float
    share_small_swing: float
    """The same in the half of the log where the swing is wider, and in the other."""
    direction: Direction
    """That of most of the residual's power."""
    hz: float | None
    """Frequency of the strongest line in that direction; None where none stands out."""
    amplitude_g: float | None
    multiple_of_swing: int | None
    """Of the swing's frequency, 1 to 4; None where the line is at none."""
    is_slow: bool = False
    """The line is at less than half the swing's frequency."""

    @property
    def where(self) -> str:
        """The direction, and the frequency where a line stands out."""
        if self.hz is None:
            return f"{self.direction}, at no single frequency"
        if self.multiple_of_swing is None:
            return f"{self.direction} at {self.hz:.3g} Hz"
        return f"{self.direction} at {MULTIPLES[self.multiple_of_swing - 1]}its frequency"

    @property
    def typical_cause(self) -> str:
        """What leaves such a remainder; empty where no line stands out."""
        if self.hz is None:
            return ""
        if self.is_slow:
            return SLOW_CAUSE
        return OTHER_CAUSE if self.multiple_of_swing is None else CAUSES[self.direction, min(self.multiple_of_swing, 2)]

    @property
    def sentence(self) -> str:
        """How much is left, where, and what is typical of it."""
        if not self.share:
            return "nothing of the motion in the log beyond the noise, but something in the data that the model was tested on"
        text = f"{percent(self.share)} of the motion is left ({percent(self.share_before)} by the nominal model)"
        text += f", mostly {self.where}"
        if self.amplitude_g is not None:
            text += f", {self.amplitude_g * 1e3:.3g} mg"
        lesser, greater = sorted((self.share_wide_swing, self.share_small_swing))
        if greater > UNEQUAL * lesser > 0:
            wide, small = percent(self.share_wide_swing), percent(self.share_small_swing)
            text += f"; {wide} where the swing is wide, {small} where it is small"
        return f"{text}; typical of {self.typical_cause}" if self.typical_cause else text


def percent(share: float) -> str:
    """Return a share in percent, to two digits."""
    return f"{float(f'{100 * share:.2g}'):g} %"
