"""Periodic terms: a force, an acceleration of the pivot, a length, a stiffness, a rotation or a reading at one frequency."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Parameter, Symbols, Values
from gateway.twin.effects.rope import add_length
from gateway.twin.effects.term import AXES, HORIZONTAL, STEPS_PER_PERIOD, Term, coefficient, frequency

REPEATS = "of one frequency"


class PeriodicTerm(Term):
    """Base class of a sum of a sine and a cosine of one frequency; their coefficients belong to a recording, like a phase."""

    steady_frequency = True
    components: tuple[str, ...] = ()
    unit: str
    typical: float

    def __init__(self) -> None:
        self.equation = f"{self.quantity} = {self.formula}"
        self.explains = self.says[0]
        self.parameters = (frequency(), *(self._part(each) for each in ("sine", "cosine")))

    def _part(self, name: str) -> Parameter:
        given = coefficient(name, self.unit, f"of the {name}", self.typical, self.components)
        return Parameter(
            **{each: getattr(given, each) for each in given.__dataclass_fields__ if each != "refitted"}, refitted=True
        )

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a part of the period."""
        return 1 / (STEPS_PER_PERIOD * p["frequency_hz"])

    def level(self, p: Symbols, context: EvaluationContext) -> tuple[Scalar, ...]:
        """Return the value of each component."""
        angle = self._angle(p, context)
        sines, cosines = p["sine"], p["cosine"]
        if not self.components:
            sines, cosines = (sines,), (cosines,)
        return tuple(a * ca.sin(angle) + b * ca.cos(angle) for a, b in zip(sines, cosines, strict=True))

    @staticmethod
    def _angle(p: Symbols, context: EvaluationContext) -> Scalar:
        return 2 * ca.pi * p["frequency_hz"] * context.time_s

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same sine and cosine counted from a later first sample."""
        angle_rad = 2 * np.pi * float(np.asarray(values["frequency_hz"])) * by_s
        turned = _complex(values) * np.exp(1j * angle_rad)
        return {**values, **_parts(turned, scalar=not self.components)}

    def amplitude(self, values: Values) -> float:
        """Return the largest value along any direction."""
        found = np.atleast_1d(_complex(values))
        return float(np.linalg.svd(np.stack([found.real, found.imag]), compute_uv=False)[0])

    def law(self, values: Values) -> str:
        """Return amplitude and frequency."""
        hz = float(np.asarray(values["frequency_hz"]))
        return f"{self.amplitude(values):.3g} {self.unit} {self.formula}, f = {hz:.4g} Hz"


def _complex(values: Values) -> np.ndarray:
    return np.asarray(values["cosine"]) - 1j * np.asarray(values["sine"])


def _parts(phasor: np.ndarray, *, scalar: bool) -> Mapping[str, float | tuple[float, ...]]:
    """Return cosine and sine of Re(c exp(i angle))."""
    if scalar:
        return {"cosine": float(phasor.real), "sine": float(-phasor.imag)}
    return {"cosine": tuple(phasor.real.tolist()), "sine": tuple((-phasor.imag).tolist())}


class PeriodicForce(PeriodicTerm):
    """A horizontal force that comes and goes."""

    name = "periodic_force"
    enters = "force on the load"
    quantity, formula, unit, typical = "force/mass", "sin(2π f t + φ)", "m/s²", 0.05
    components = HORIZONTAL
    says = ("the load is pushed at one frequency, as by gusts",) * 2

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force."""
        x, y = self.level(p, context)
        return x, y, 0.0


class PivotSway(PeriodicTerm):
    """A pivot that moves to and fro."""

    name = "pivot_sway"
    enters = "pivot"
    quantity, formula, unit, typical = "pivot acceleration", "sin(2π f t + φ), horizontal", "m/s²", 0.05
    components = HORIZONTAL
    says = ("the pivot moves to and fro, as by a jib or a gantry that sways",) * 2

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration."""
        x, y = self.level(p, context)
        return x, y, 0.0


class PivotHeave(PeriodicTerm):
    """A pivot that rises and falls."""

    name = "pivot_heave"
    enters = "pivot"
    quantity, formula, unit, typical = "pivot acceleration", "sin(2π f t + φ), vertical", "m/s²", 0.05
    says = ("the pivot rises and falls, as of a floating crane",) * 2

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration."""
        return 0.0, 0.0, self.level(p, context)[0]


class PeriodicLength(PeriodicTerm):
    """A rope whose length comes and goes; the housing keeps its distance to the load."""

    name = "periodic_length"
    enters = "rope"
    quantity, formula, unit, typical = "rope length", "sin(2π f t + φ)", "m", 0.005
    says = ("the rope becomes longer and shorter, as by a winch that hunts",) * 2

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change both distances."""
        angle, rate = self._angle(p, context), 2 * ca.pi * p["frequency_hz"]
        change = p["sine"] * ca.sin(angle) + p["cosine"] * ca.cos(angle)
        change_rate = rate * (p["sine"] * ca.cos(angle) - p["cosine"] * ca.sin(angle))
        changes = (change, change_rate, -(rate**2) * change)
        return RopeGeometry(add_length(geometry.length, *changes), add_length(geometry.position, *changes))


class PeriodicStiffness(PeriodicTerm):
    """A force by the displacement whose factor comes and goes."""

    name = "periodic_stiffness"
    enters = "force on the load"
    quantity, formula, unit, typical = "force/mass", "(x, y) sin(2π f t + φ)", "1/s²", 0.01
    says = ("the swing is stiffer and softer in turn",) * 2

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force."""
        (factor,) = self.level(p, context)
        x, y, _ = load.position_m
        return factor * x, factor * y, 0.0


class PeriodicRotation(PeriodicTerm):
    """A housing that twists to and fro about the rope."""

    name = "periodic_rotation"
    enters = "housing"
    quantity, formula, unit, typical = "rotation about the rope", "sin(2π f t + φ)", "rad", 0.05
    says = ("the housing twists to and fro about the rope",) * 2

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return self.level(p, context)[0]


class PeriodicOffset(PeriodicTerm):
    """A reading with a slow sine added."""

    name = "periodic_offset"
    enters = "sensor"
    quantity, formula, unit, typical = "reading", "sin(2π f t + φ)", "g", 0.002
    components = AXES
    says = ("the reading itself goes up and down at one frequency",) * 2

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the sine to each axis."""
        x, y, z = (f + each for f, each in zip(reading, self.level(p, context), strict=True))
        return x, y, z


PERIODIC_TERMS: tuple[PeriodicTerm, ...] = (
    PeriodicForce(),
    PivotSway(),
    PivotHeave(),
    PeriodicLength(),
    PeriodicStiffness(),
    PeriodicRotation(),
    PeriodicOffset(),
)
