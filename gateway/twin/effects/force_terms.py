"""Terms of the force on the load, by its velocity, its displacement and time."""

from collections.abc import Callable

from devices.pendulum.equations import Scalar, Vector, add, scale
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, BodyState, EvaluationContext
from gateway.twin.effects.parameter import Symbols, Values
from gateway.twin.effects.term import HORIZONTAL, SMOOTHING_SPEED_M_S, Term, coefficient, number, smoothed_length

Basis = Callable[[BodyState], tuple[Vector, ...]]
"""The vectors that the coefficients multiply, one for each component."""
MIRRORED = ("xx", "xy")
"""Components of a symmetric matrix without a trace: (a, b; b, -a)."""


class ForceTerm(Term):
    """A force on the load over its mass: coefficients times vectors of its motion."""

    enters = "force on the load"
    quantity = "force/mass"

    def __init__(
        self,
        name: str,
        formula: str,
        unit: str,
        typical: float,
        basis: Basis,
        *,
        says: tuple[str, str],
        components: tuple[str, ...] = (),
    ) -> None:
        self.name, self.formula, self.says = name, formula, says
        self.equation, self.explains = f"F/m = c {formula}", says[0]
        self.world_directed = bool(components)
        self.parameters = (coefficient("coefficient", unit, "c", typical, components),)
        self._basis = basis

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the sum of coefficients times vectors."""
        return _combine(self._coefficients(p), self._basis(load))

    def _coefficients(self, p: Symbols) -> tuple[Scalar, ...]:
        found = p["coefficient"]
        return found if self.parameters[0].components else (found,)


class ChangingForceTerm(Term):
    """A force whose coefficient changes evenly with time: c + c' t."""

    enters = "force on the load"
    quantity = "force/mass"

    def __init__(
        self,
        name: str,
        formula: str,
        units: tuple[str, str],
        typical: tuple[float, float],
        basis: Basis,
        *,
        extends: str,
        says: tuple[str, str],
        components: tuple[str, ...] = (),
    ) -> None:
        self.name, self.formula, self.says, self.extends = name, formula, says, extends
        self.equation, self.explains = f"F/m = (c + c′ t) {formula}", says[0]
        self.world_directed = bool(components)
        self.parameters = (
            coefficient("slope", units[1], "c′", typical[1], components),
            coefficient("level", units[0], "c at the first sample", typical[0], components),
        )
        self._basis = basis

    def force_m_s2(self, p: Symbols, context: EvaluationContext, load: BodyState) -> Vector:
        """Return the sum of coefficients times vectors."""
        levels, slopes = p["level"], p["slope"]
        if not self.parameters[0].components:
            levels, slopes = (levels,), (slopes,)
        now = tuple(level + slope * context.time_s for level, slope in zip(levels, slopes, strict=True))
        return _combine(now, self._basis(load))

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same force counted from a later first sample."""
        return shifted_level(values, by_s)

    def law(self, values: Values) -> str:
        """Return the right-hand side with numbers and units."""
        slope, level = self.parameters
        return f"({number(values['level'])} {level.unit} {number(values['slope'])} {slope.unit} t) {self.formula}"


def shifted_level(values: Values, by_s: float) -> Values:
    """Return a level and a slope for a recording whose first sample is later."""
    level, slope = values["level"], values["slope"]
    if isinstance(level, tuple) and isinstance(slope, tuple):
        return {**values, "level": tuple(a + b * by_s for a, b in zip(level, slope, strict=True))}
    assert isinstance(level, float)
    assert isinstance(slope, float)
    return {**values, "level": level + slope * by_s}


def _combine(coefficients: tuple[Scalar, ...], vectors: tuple[Vector, ...]) -> Vector:
    total = ZERO_VECTOR
    for each, vector in zip(coefficients, vectors, strict=True):
        total = add(total, scale(each, vector))
    return total


def _velocity(load: BodyState) -> tuple[Vector, ...]:
    return (load.velocity_m_s,)


def _speed_velocity(load: BodyState) -> tuple[Vector, ...]:
    return (scale(_speed(load), load.velocity_m_s),)


def _direction_of_motion(load: BodyState) -> tuple[Vector, ...]:
    return (scale(1 / _speed(load), load.velocity_m_s),)


def _cubic_velocity(load: BodyState) -> tuple[Vector, ...]:
    return (scale(_speed(load) ** 2, load.velocity_m_s),)


def _speed(load: BodyState) -> Scalar:
    return smoothed_length(load.velocity_m_s, SMOOTHING_SPEED_M_S)


def _displacement(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return ((x, y, 0.0),)


def _cubic_displacement(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return (scale(x * x + y * y, (x, y, 0.0)),)


def _mirrored_displacement(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return (x, -y, 0.0), (y, x, 0.0)


def _mirrored_velocity(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.velocity_m_s
    return (x, -y, 0.0), (y, x, 0.0)


def _velocity_aside(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.velocity_m_s
    return ((-y, x, 0.0),)


def _displacement_aside(load: BodyState) -> tuple[Vector, ...]:
    x, y, _ = load.position_m
    return ((-y, x, 0.0),)


def _horizontal(load: BodyState) -> tuple[Vector, ...]:
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


FED, TAKEN = "energy is fed in", "energy is taken out"
FORCE_TERMS: tuple[Term, ...] = (
    ForceTerm("force_by_velocity", "v", "1/s", 4e-3, _velocity, says=(FED, TAKEN)),
    ForceTerm(
        "force_by_speed_squared",
        "|v| v",
        "1/m",
        4e-3,
        _speed_velocity,
        says=(f"{FED}, more at large swings", f"{TAKEN}, more at large swings"),
    ),
    ForceTerm(
        "force_along_motion",
        "v/|v|",
        "m/s²",
        3e-3,
        _direction_of_motion,
        says=(f"{FED}, whatever the speed", f"{TAKEN}, whatever the speed, as by friction"),
    ),
    ForceTerm(
        "force_by_speed_cubed",
        "|v|² v",
        "s/m²",
        4e-3,
        _cubic_velocity,
        says=(f"{FED}, mostly at large swings", f"{TAKEN}, mostly at large swings"),
    ),
    ForceTerm(
        "force_by_displacement",
        "(x, y)",
        "1/s²",
        5e-3,
        _displacement,
        says=("softer than a pendulum", "stiffer than a pendulum"),
    ),
    ForceTerm(
        "force_by_displacement_cubed",
        "(x² + y²) (x, y)",
        "1/(m² s²)",
        5e-3,
        _cubic_displacement,
        says=("softer at large swings", "stiffer at large swings"),
    ),
    ForceTerm(
        "force_by_mirrored_displacement",
        "(x, −y), (y, x)",
        "1/s²",
        5e-3,
        _mirrored_displacement,
        components=MIRRORED,
        says=("stiffer in one direction than across it",) * 2,
    ),
    ForceTerm(
        "force_by_mirrored_velocity",
        "(v_x, −v_y), (v_y, v_x)",
        "1/s",
        4e-3,
        _mirrored_velocity,
        components=MIRRORED,
        says=("damped more in one direction than across it",) * 2,
    ),
    ForceTerm(
        "force_across_velocity",
        "z × v",
        "1/s",
        4e-3,
        _velocity_aside,
        says=("the plane of the swing turns anticlockwise", "the plane of the swing turns clockwise"),
    ),
    ForceTerm(
        "force_across_displacement",
        "z × (x, y)",
        "1/s²",
        4e-3,
        _displacement_aside,
        says=("the load is pushed around anticlockwise", "the load is pushed around clockwise"),
    ),
    ForceTerm(
        "constant_force",
        "(e_x, e_y)",
        "m/s²",
        0.02,
        _horizontal,
        components=HORIZONTAL,
        says=("a steady push to one side",) * 2,
    ),
    ChangingForceTerm(
        "changing_force",
        "(e_x, e_y)",
        ("m/s²", "m/s³"),
        (0.02, 4e-4),
        _horizontal,
        components=HORIZONTAL,
        extends="constant_force",
        says=("a push to one side that changes with time",) * 2,
    ),
    ChangingForceTerm(
        "changing_force_by_velocity",
        "v",
        ("1/s", "1/s²"),
        (4e-3, 1e-4),
        _velocity,
        extends="force_by_velocity",
        says=("the damping falls with time", "the damping rises with time"),
    ),
    ChangingForceTerm(
        "changing_force_by_displacement",
        "(x, y)",
        ("1/s²", "1/s³"),
        (5e-3, 1e-4),
        _displacement,
        extends="force_by_displacement",
        says=("the swing becomes slower with time", "the swing becomes faster with time"),
    ),
)
"""Without a steady period."""
