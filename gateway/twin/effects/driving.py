"""What pushes the load or moves the pivot."""

from typing import Any

import casadi as ca

from devices.simulated.equations import Scalar, Vector
from gateway.twin.effects.effect import Body, Effect, Moment, Parameter, Symbols

HORIZONTAL = ("x", "y")


def start(typical: float) -> Parameter:
    """When an event starts."""
    return Parameter("start_s", "s", "when it starts, in the recording's time", 0.0, 1e6, 0.0, 0.1, typical)


def duration(typical: float, name: str = "duration_s") -> Parameter:
    """How long an event or a part of it lasts."""
    return Parameter(name, "s", "how long it lasts", 0.05, 600.0, 5.0, 0.1, typical)


def horizontal(p: Any, factor: Scalar) -> Vector:
    """A horizontal vector, scaled."""
    return factor * p[0], factor * p[1], 0.0


class SteadyWind(Effect):
    """A lean that stays."""

    name = "steady_wind"
    equation = "F/m = (a_x, a_y, 0)"
    explains = "A steady side pull: wind on the load, or a tag line; the rope leans and swings about the lean."
    reference = "statics: lean = arctan(a/g)"
    enters = "force on the load"
    parameters = (
        Parameter("accel_m_s2", "m/s²", "force over the load's mass", -2.0, 2.0, 0.0, 0.01, (0.2, 0.0), HORIZONTAL),
    )

    def force_m_s2(self, p: Symbols, now: Moment, load: Body) -> Vector:
        """The same always."""
        return horizontal(p["accel_m_s2"], 1.0)


class WindGust(Effect):
    """A push that lasts for a time."""

    name = "wind_gust"
    equation = "F/m = (a_x, a_y, 0) (1 − cos(2π (t − t₀)/T))/2 for t₀ ≤ t < t₀ + T"
    explains = "A gust, or a pull on the load for some seconds."
    reference = "the one-minus-cosine gust of load standards (EN 61400-1, CS 25.341)"
    enters = "force on the load"
    transient = True
    parameters = (
        Parameter("accel_m_s2", "m/s²", "force over the load's mass", -5.0, 5.0, 0.0, 0.01, (0.25, 0.1), HORIZONTAL),
        start(30.0),
        duration(5.0),
    )

    def edges(self, p: Symbols) -> tuple[Scalar, ...]:
        """Its start and its end."""
        return p["start_s"], p["start_s"] + p["duration_s"]

    def longest_step_s(self, p: Symbols, length_m: float) -> Scalar:
        """Eight steps at least."""
        return p["duration_s"] / 8

    def force_m_s2(self, p: Symbols, now: Moment, load: Body) -> Vector:
        """Rises to the full force and falls again."""
        progress = (now.time_s - p["start_s"]) / p["duration_s"]
        return horizontal(p["accel_m_s2"], now.within(*self.edges(p)) * (1 - ca.cos(2 * ca.pi * progress)) / 2)


class Impact(Effect):
    """A blow."""

    name = "impact"
    equation = "v⁺ = v⁻ + (Δv_x, Δv_y, 0) at t₀"
    explains = "Something struck the load, or the load struck something."
    reference = "impulse over the load's mass; the rope takes the part along it"
    enters = "force on the load"
    transient = True
    parameters = (
        Parameter("delta_v_m_s", "m/s", "jump of velocity", -5.0, 5.0, 0.0, 0.01, (0.2, 0.1), HORIZONTAL),
        start(30.0),
    )

    def edges(self, p: Symbols) -> tuple[Scalar, ...]:
        """The instant of the blow."""
        return (p["start_s"],)

    def kick(self, p: Symbols) -> Vector:
        """The jump."""
        return horizontal(p["delta_v_m_s"], 1.0)


class TrolleyAcceleration(Effect):
    """The pivot speeds up, runs on, slows down."""

    name = "trolley_acceleration"
    equation = "a_p = (a_x, a_y, 0) for T from t₀, 0 for T_c, then the opposite for T"
    explains = "The trolley or the bridge was driven."
    reference = "trapezoidal speed profile of a drive"
    enters = "pivot"
    transient = True
    parameters = (
        Parameter("accel_m_s2", "m/s²", "of the pivot", -2.0, 2.0, 0.0, 0.01, (0.2, 0.1), HORIZONTAL),
        start(30.0),
        duration(3.0),
        duration(5.0, "coast_s"),
    )

    def edges(self, p: Symbols) -> tuple[Scalar, ...]:
        """Starts and ends of speeding up and of slowing down."""
        begin, ramp, coast = p["start_s"], p["duration_s"], p["coast_s"]
        return begin, begin + ramp, begin + ramp + coast, begin + 2 * ramp + coast

    def pivot_m_s2(self, p: Symbols, now: Moment) -> Vector:
        """Constant on each ramp."""
        edges = self.edges(p)
        return horizontal(p["accel_m_s2"], now.within(*edges[:2]) - now.within(*edges[2:]))
