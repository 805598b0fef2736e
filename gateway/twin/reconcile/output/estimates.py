"""What a reconciliation estimates: the parameters of effects, and the law of what no effect explains."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects.parameter import Value


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


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """An effect that the data hold."""

    name: str
    explains: str
    equation: str
    parameters: Mapping[str, Estimate]
    when_s: tuple[float, float] | None
    """When a transient effect acted."""


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
