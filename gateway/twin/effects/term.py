"""What a term is: a part of a law that describes what no effect of the vocabulary explains.

A term is an effect that is linear in its coefficients where they are zero. Its type fixes the unit of the coefficients, so
that a law has one. Terms are kept apart from the vocabulary, and no search for effects tries them.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.parameter import (
    Parameter,
    Symbols,
    Value,
    Values,
    amplitude,
    frequency,
    without_rounding,
)

LARGEST = 100.0
"""Bound of a coefficient in typical sizes. Basis: a fit that reaches it describes nothing."""
REFERENCE = "sparse regression over a library of terms (Brunton et al. 2016), in weak form (Messenger and Bortz 2021)"
HIGHEST_FREQUENCY_HZ = 3.0
STEPS_PER_PERIOD = 16
"""Integration steps in a period of a periodic coefficient. Basis: a choice; the integration of order six errs by far less than a
sensor shows."""
SINE = "sin(2π f t + φ)"
"""What the formula of a periodic term begins with."""
PHASORS = ("sine", "cosine")
FREQUENCY = frequency("f", (0.005, HIGHEST_FREQUENCY_HZ), 0.4, step_limit=0.01)


class Term(Effect):
    """Base class of the terms of a law."""

    reference = REFERENCE
    scored: ClassVar[bool | None] = False
    found_before_search: ClassVar[bool] = True
    quantity: str
    """The left-hand side of the law: force/mass, pivot acceleration, rope length, rotation or reading."""
    formula: str
    """What the coefficients multiply."""
    says: tuple[str, ...]
    """The law in an operator's words, for a positive and for a negative first coefficient where they differ."""

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
        first = float(np.atleast_1d(np.asarray(values[self.coefficients[0].name], dtype=np.float64))[0])
        return self.says[0 if first >= 0 else -1]

    def feeds_energy(self, values: Values) -> bool:
        """Return whether the term with these values pushes the load along its motion at all times."""
        return False

    def law(self, values: Values) -> str:
        """Return the right-hand side with numbers and units: `+0.0042 1/s v`."""
        return " ".join(f"{number(values[p.name])} {p.unit} {self.formula}" for p in self.coefficients)


def coefficient(name: str, unit: str, meaning: str, typical: float, components: tuple[str, ...] = ()) -> Parameter:
    """Return the parameter of a coefficient; `typical` is the size of one that shows."""
    bounds = (-LARGEST * typical, LARGEST * typical)
    return amplitude(name, unit, meaning, bounds, typical, components)


def number(value: Value) -> str:
    """Return a coefficient with its sign: `+0.0042`, or `(+0.012, -0.003)`."""
    texts = [f"{without_rounding(each):+.3g}" for each in np.atleast_1d(np.asarray(value, dtype=np.float64))]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def _phasor(values: Mapping[str, Value]) -> NDArray[np.complex128]:
    """Return c of Re(c exp(i angle))."""
    return np.asarray(values["cosine"]) - 1j * np.asarray(values["sine"])


def _value(numbers: NDArray[np.float64]) -> Value:
    return tuple(numbers.tolist()) if numbers.ndim else float(numbers)


class CoefficientTerm(Term):
    """Base class of terms whose parameters are coefficients; a subclass says which quantity they act on.

    A coefficient is constant, or a sine and a cosine of one frequency, which belong to a recording as a phase does.
    """

    has_direction: ClassVar[bool] = False
    """Whether components are directions in the world, which turn with the heading of a recording."""

    def __init__(
        self,
        name: str,
        formula: str,
        unit: str,
        typical: float,
        components: tuple[str, ...] = (),
        *,
        says: tuple[str, ...],
    ) -> None:
        """`typical`: size of a coefficient that shows; `components`: their names, empty for a single number."""
        self.name, self.formula, self.unit, self.says = name, formula, unit, says
        self.equation, self.explains = f"{self.quantity} = c {formula}", says[0]
        self.steady_frequency = formula.startswith(SINE)
        self.world_directed = self.has_direction and bool(components) and not self.steady_frequency
        self.parameters = (coefficient("coefficient", unit, "c", typical, components),)
        if self.steady_frequency:
            parts = (coefficient(each, unit, f"of the {each}", typical, components) for each in PHASORS)
            self.parameters = (FREQUENCY, *(replace(part, refitted=True) for part in parts))

    def coefficients_at(self, p: Symbols, context: EvaluationContext) -> tuple[Scalar, ...]:
        """Return the coefficients at an instant, one for each component."""

        def each(name: str) -> tuple[Scalar, ...]:
            return p[name] if self.coefficients[0].components else (p[name],)

        if not self.steady_frequency:
            return each("coefficient")
        angle = 2 * ca.pi * p["frequency_hz"] * context.time_s
        parts = zip(*map(each, PHASORS), strict=True)
        return tuple(sine * ca.sin(angle) + cosine * ca.cos(angle) for sine, cosine in parts)

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a part of the period, where there is one."""
        return 1 / (STEPS_PER_PERIOD * p["frequency_hz"]) if self.steady_frequency else math.inf

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same term counted from a later first sample."""
        if not self.steady_frequency:
            return values
        angle_rad = 2 * np.pi * float(np.asarray(values["frequency_hz"])) * by_s
        turned = _phasor(values) * np.exp(1j * angle_rad)
        return {**values, "cosine": _value(turned.real), "sine": _value(-turned.imag)}

    def law(self, values: Values) -> str:
        """Return the right-hand side with numbers and units; of a sine the largest value along any direction."""
        if not self.steady_frequency:
            return super().law(values)
        phasor, hz = np.atleast_1d(_phasor(values)), float(np.asarray(values["frequency_hz"]))
        size = np.linalg.svd(np.stack([phasor.real, phasor.imag]), compute_uv=False)[0]
        return f"{size:.3g} {self.unit} {self.formula}, f = {hz:.4g} Hz"
