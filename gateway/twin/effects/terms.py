"""The library of terms, and their time in the registry of effects."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import casadi as ca
import numpy as np

from devices.pendulum.equations import Scalar, Vector, add, scale
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, BodyState, EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Symbols, Values, shape
from gateway.twin.effects.term import SINE, CoefficientTerm, Term, coefficient, number

HORIZONTAL, AXES = ("x", "y"), ("x", "y", "z")
SMOOTHING_G = 1e-6
"""Amplitude of a reading that counts as none. Basis: a choice; below the noise of a mean, above rounding."""
SMOOTHING_M = 1e-3
"""Displacement that counts as none. Basis: a choice; below a displacement that a reading shows, above rounding."""
VECTORS: Mapping[str, Callable[[BodyState], tuple[Vector, ...]]] = {
    "v": lambda load: (load.velocity_m_s,),
    "|v| v": lambda load: (scale(load.speed_m_s, load.velocity_m_s),),
    "v/|v|": lambda load: (load.direction_of_motion(),),
    "(x, y)": lambda load: ((load.position_m[0], load.position_m[1], 0.0),),
    "(x, −y), (y, x)": lambda load: (
        (load.position_m[0], -load.position_m[1], 0.0),
        (load.position_m[1], load.position_m[0], 0.0),
    ),
    "z × v": lambda load: ((-load.velocity_m_s[1], load.velocity_m_s[0], 0.0),),
    "(e_x, e_y)": lambda _load: ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    SINE: lambda _load: ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}
"""The vectors that the coefficients of a force multiply, one for each component, by the force's formula."""
ALONG_MOTION = ("v", "|v| v", "v/|v|")
FED, TAKEN = "energy is fed in", "energy is taken out"


class ForceTerm(CoefficientTerm):
    """A force on the load over its mass: coefficients times vectors of its motion."""

    enters = "force on the load"
    quantity = "force/mass"
    has_direction = True

    def feeds_energy(self, values: Values) -> bool:
        """Return whether the force is along the velocity."""
        return self.formula in ALONG_MOTION and all(np.min(values[each.name]) > 0 for each in self.coefficients)

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the sum of coefficients times vectors."""
        total = ZERO_VECTOR
        for each, vector in zip(self.coefficients_at(p, context), VECTORS[self.formula](load), strict=True):
            total = add(total, scale(each, vector))
        return total


class PivotTerm(CoefficientTerm):
    """An acceleration of the pivot, horizontal with two components and vertical with one."""

    enters = "pivot"
    quantity = "pivot acceleration"

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the acceleration."""
        found = self.coefficients_at(p, context)
        return (found[0], found[1], 0.0) if len(found) > 1 else (0.0, 0.0, found[0])


class LengthTerm(CoefficientTerm):
    """A rope whose length changes; the housing keeps its distance to the load."""

    enters = "rope"
    quantity = "rope length"

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change both distances."""
        time = ca.SX.sym("time")
        (change,) = self.coefficients_at(p, replace(context, time_s=time))
        rate = ca.jacobian(change, time)
        parts = ca.vertcat(change, rate, ca.jacobian(rate, time))
        changes = ca.vertsplit(ca.substitute(parts, time, context.time_s))
        return geometry.with_changes(changes, changes)


class RotationTerm(CoefficientTerm):
    """A rotation of the housing about the rope."""

    enters = "housing"
    quantity = "rotation about the rope"

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return self.coefficients_at(p, context)[0]


class SteadyRotation(RotationTerm):
    """A housing that turns evenly; its angle at the first sample is the heading."""

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle."""
        return super().housing_rotation_rad(p, context) * context.time_s


class OffsetTerm(CoefficientTerm):
    """An offset of each axis."""

    enters = "sensor"
    quantity = "reading"

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the offset."""
        x, y, z = self.coefficients_at(p, context)
        return add(reading, (x, y, z))


class CreepingOffset(Term):
    """An offset that settles after the start."""

    name = "creeping_offset"
    enters = "sensor"
    quantity = "reading"
    equation = "f_i + b_i exp(−t/τ)"
    formula = "exp(−t/τ)"
    says = ("the sensor's zero settles after the start",)
    explains = says[0]
    parameters = (
        # What is over within two seconds, part of a swing, is no offset that settles.
        shape("time_constant_s", "s", "τ", (2.0, 1e4), 10.0, step_limit=20.0),
        coefficient("offset_g", "g", "b of each axis at the first sample", 5e-3, AXES),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add an offset that decays."""
        return add(reading, scale(ca.exp(-context.time_s / p["time_constant_s"]), p["offset_g"]))

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return what is left of the offset at a later first sample."""
        left = float(np.exp(-by_s / float(np.asarray(values["time_constant_s"]))))
        return {**values, "offset_g": tuple((left * np.asarray(values["offset_g"])).tolist())}

    def law(self, values: Values) -> str:
        """Return offset and time constant."""
        tau_s = float(np.asarray(values["time_constant_s"]))
        return f"{number(values['offset_g'])} g {self.formula}, τ = {tau_s:.3g} s"


class QuadraticReading(Term):
    """A sensitivity that bends."""

    name = "quadratic_reading"
    enters = "sensor"
    quantity = "reading"
    equation = "f_i + k_i (f_i − f_i0)², f_0 the reading at rest"
    formula = "(f − f_0)²"
    says = ("the sensitivity changes with what is read",)
    explains = says[0]
    parameters = (coefficient("per_g", "1/g", "k of each axis", 0.5, AXES),)

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the square of the change."""
        parts = zip(reading, (0.0, 0.0, 1.0), p["per_g"], strict=True)
        x, y, z = (f + k * (f - rest) ** 2 for f, rest, k in parts)
        return x, y, z


class DelayedReading(Term):
    """A reading whose axes across the rope are sampled later than the axial one, to first order in the delay.

    A delay of all three axes is another start of the same motion, and shows nowhere.
    """

    name = "delayed_reading"
    enters = "sensor"
    quantity = "reading"
    equation = "f_i(t − τ_i) ≈ f_i − τ_i f′_i, i across the rope"
    formula = "−f′"
    says = (
        "the axes across the rope are read later than the axial one",
        "the axes across the rope are read earlier than the axial one",
    )
    explains = says[0]
    needs_quadrature = True
    parameters = (coefficient("delay_s", "s", "τ, behind the axial axis", 0.02, HORIZONTAL),)

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Subtract what the reading changes during the delay."""
        x, y, z = reading
        (x_rate, y_rate, _), (x_delay_s, y_delay_s) = context.quadrature_g, p["delay_s"]
        rate_1_s = context.small_swing_rate_1_s
        return x - x_delay_s * rate_1_s * x_rate, y - y_delay_s * rate_1_s * y_rate, z


class ForceWithDeadZone(Term):
    """A force by the displacement with a dead zone: nothing acts near the middle."""

    name = "force_with_dead_zone"
    enters = "force on the load"
    quantity = "force/mass"
    equation = "F/m = c (1 − b/r) (x, y) where r = |(x, y)| > b"
    formula = "(1 − b/r) (x, y), r > b"
    says = ("pushed outwards beyond a dead zone", "held back beyond a dead zone, as by a guide with play")
    explains = says[1]
    parameters = (
        shape("dead_zone_m", "m", "b, displacement up to which nothing acts", (1e-4, 100.0), 0.5, step_limit=0.1),
        coefficient("coefficient", "1/s²", "c", 0.02),
    )

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the force."""
        x, y, _ = load.position_m
        factor = p["coefficient"] * ca.fmax(0.0, 1 - p["dead_zone_m"] / ca.sqrt(x**2 + y**2 + SMOOTHING_M**2))
        return factor * x, factor * y, 0.0

    def law(self, values: Values) -> str:
        """Return coefficient and dead zone."""
        return f"{super().law(values)}, b = {float(np.asarray(values['dead_zone_m'])):.3g} m"


class Backlash(Term):
    """A reading with play: after each turning point it stays until the motion has crossed the play.

    The play of a sine of amplitude A, in closed form: coming down from A, the follower is behind by min(A - f, 2 b) - b.
    """

    name = "backlash"
    enters = "sensor"
    quantity = "reading"
    equation = "f_i + c_i e(f_i), e in (−b, b) behind the motion, i across the rope"
    formula = "e(f)"
    says = ("play: the reading turns back later than the load",)
    explains = says[0]
    needs_quadrature = True
    hides_small_motion = True
    parameters = (
        shape("gap_g", "g", "b, half of the play", (1e-5, 1.0), 2e-3, step_limit=5e-3),
        coefficient("share", "1", "c, share of the reading that has play", 0.5, HORIZONTAL),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add what the play lags behind to the axes across the rope."""
        x, y, z = reading
        (x_rate, y_rate, _), (x_share, y_share) = context.quadrature_g, p["share"]
        return x + x_share * _lag_g(x, x_rate, p["gap_g"]), y + y_share * _lag_g(y, y_rate, p["gap_g"]), z

    def law(self, values: Values) -> str:
        """Return share and gap."""
        return f"{number(values['share'])} {self.formula}, b = {float(np.asarray(values['gap_g'])):.3g} g"


def _lag_g(reading: Scalar, quadrature: Scalar, gap: Scalar) -> Scalar:
    amplitude = ca.sqrt(reading**2 + quadrature**2 + SMOOTHING_G**2)
    falling = ca.fmin(amplitude - reading, 2 * gap) - gap
    rising = gap - ca.fmin(amplitude + reading, 2 * gap)
    return ca.if_else(quadrature < 0, falling, rising)


TERMS: Mapping[str, Term] = {
    term.name: term
    for term in (
        ForceTerm("force_by_velocity", "v", "1/s", 4e-3, says=(FED, TAKEN)),
        ForceTerm(
            "force_by_speed_squared",
            "|v| v",
            "1/m",
            4e-3,
            says=tuple(f"{each}, more at large swings" for each in (FED, TAKEN)),
        ),
        ForceTerm(
            "force_along_motion",
            "v/|v|",
            "m/s²",
            3e-3,
            says=(f"{FED}, whatever the speed", f"{TAKEN}, whatever the speed, as by friction"),
        ),
        ForceTerm(
            "force_by_displacement", "(x, y)", "1/s²", 5e-3, says=("softer than a pendulum", "stiffer than a pendulum")
        ),
        # Components of a symmetric matrix without a trace: (a, b; b, -a).
        ForceTerm(
            "force_by_mirrored_displacement",
            "(x, −y), (y, x)",
            "1/s²",
            5e-3,
            ("xx", "xy"),
            says=("stiffer in one direction than across it",),
        ),
        ForceTerm(
            "force_across_velocity",
            "z × v",
            "1/s",
            4e-3,
            says=("the plane of the swing turns anticlockwise", "the plane of the swing turns clockwise"),
        ),
        ForceTerm("constant_force", "(e_x, e_y)", "m/s²", 0.02, HORIZONTAL, says=("a steady push to one side",)),
        ForceTerm(
            "periodic_force", SINE, "m/s²", 0.05, HORIZONTAL, says=("the load is pushed at one frequency, as by gusts",)
        ),
        PivotTerm(
            "pivot_sway",
            f"{SINE}, horizontal",
            "m/s²",
            0.05,
            HORIZONTAL,
            says=("the pivot moves to and fro, as by a jib or a gantry that sways",),
        ),
        PivotTerm("pivot_heave", f"{SINE}, vertical", "m/s²", 0.05, says=("the pivot heaves, as of a floating crane",)),
        LengthTerm(
            "periodic_length", SINE, "m", 0.005, says=("the rope becomes longer and shorter, as by a winch that hunts",)
        ),
        RotationTerm("periodic_rotation", SINE, "rad", 0.05, says=("the housing twists to and fro about the rope",)),
        SteadyRotation(
            "steady_rotation",
            "t",
            "rad/s",
            0.01,
            says=("the housing turns anticlockwise about the rope", "the housing turns clockwise about the rope"),
        ),
        OffsetTerm(
            "periodic_offset", SINE, "g", 0.002, AXES, says=("the reading itself goes up and down at one frequency",)
        ),
        CreepingOffset(),
        QuadraticReading(),
        DelayedReading(),
        ForceWithDeadZone(),
        Backlash(),
    )
}
"""Every term by its name."""
OF_MODELS, OF_SEARCH = "the terms of a model", "the library of terms"
"""Sources in the registry of effects."""


def register_terms(names: Iterable[str]) -> None:
    """Add those terms that a model names to the registry, to stay; other names are left alone."""
    EFFECTS.register([TERMS[name] for name in names if name in TERMS and name not in EFFECTS], OF_MODELS)


@contextmanager
def registered_library() -> Iterator[None]:
    """Add all terms to the registry of effects for as long as a law is sought."""
    EFFECTS.register([term for name, term in TERMS.items() if name not in EFFECTS], OF_SEARCH)
    try:
        yield
    finally:
        EFFECTS.unregister(OF_SEARCH)
