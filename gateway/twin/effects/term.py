"""The base class of terms: parts of a law that describes what no effect of the vocabulary explains.

A term is an effect that is linear in its coefficients where they are zero. Its type fixes the unit of the coefficients, so
that a law has one. Terms are kept apart from the vocabulary, and no search for effects tries them.
"""

from typing import ClassVar

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector, dot
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.parameter import Parameter, Value, Values, without_rounding

HORIZONTAL = ("x", "y")
AXES = ("x", "y", "z")
LARGEST = 100.0
"""Bound of a coefficient in typical sizes. Basis: a fit that reaches it describes nothing."""
REFERENCE = "sparse regression over a library of terms (Brunton et al. 2016), in weak form (Messenger and Bortz 2021)"


class Term(Effect):
    """Base class of the terms of a law."""

    reference = REFERENCE
    scored: ClassVar[bool | None] = False
    found_before_search: ClassVar[bool] = True
    quantity: str
    """The left-hand side of the law: force/mass, pivot acceleration, rope length, rotation or reading."""
    formula: str
    """What the coefficients multiply."""
    says: tuple[str, str]
    """The law in an operator's words, for a positive and for a negative first coefficient."""

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        """The parameters in which the term is linear."""
        return tuple(p for p in self.parameters if p.neutral == 0.0)

    @property
    def shape_parameters(self) -> tuple[Parameter, ...]:
        """The other ones: a frequency or a time constant."""
        return tuple(p for p in self.parameters if p.neutral != 0.0)

    def in_words(self, values: Values) -> str:
        """Return what the law with these values means for an operator."""
        positive, negative = self.says
        first = float(np.atleast_1d(np.asarray(values[self.coefficients[0].name], dtype=np.float64))[0])
        return positive if first >= 0 else negative

    def feeds_energy(self, values: Values) -> bool:
        """Return whether the term with these values pushes the load along its motion at all times."""
        return False

    def law(self, values: Values) -> str:
        """Return the right-hand side with numbers and units: `+0.0042 1/s v`."""
        parts = [f"{number(values[p.name])} {p.unit} {self.formula}" for p in self.coefficients]
        return " ".join(parts)


def coefficient(name: str, unit: str, meaning: str, typical: float, components: tuple[str, ...] = ()) -> Parameter:
    """Return the parameter of a coefficient; `typical` is the size of one that shows."""
    return Parameter(
        name,
        unit,
        meaning,
        lower=-LARGEST * typical,
        upper=LARGEST * typical,
        neutral=0.0,
        scale=typical / 10,
        typical=tuple(typical for _ in components) if components else typical,
        components=components,
    )


def number(value: Value) -> str:
    """Return a coefficient with its sign: `+0.0042`, or `(+0.012, -0.003)`."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
    texts = [f"{without_rounding(each):+.3g}" for each in numbers]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def smoothed_length(vector: Vector, within: float) -> Scalar:
    """Return the length of a vector, smooth at zero."""
    return ca.sqrt(dot(vector, vector) + within**2)
