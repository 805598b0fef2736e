"""Something that goes on for a time: it rises, stays and falls."""

from dataclasses import dataclass

import casadi as ca

from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import EvaluationContext, Parameter, ParameterKind
from gateway.twin.effects.pulse_shape import SHARPEST


def start(typical: float, operator_sigma: float | None = None) -> Parameter:
    """Return the parameter that says when an event starts."""
    return Parameter(
        "start_s",
        "s",
        "when it starts, in the recording's time",
        0.0,
        1e6,
        0.0,
        0.1,
        typical,
        kind=ParameterKind.START,
        step_limit=2.0,
        operator_sigma=operator_sigma,
    )


def duration(typical: float, name: str = "duration_s", operator_sigma: float | None = None) -> Parameter:
    """Return a parameter that says how long an event or a part of it lasts."""
    return Parameter(
        name,
        "s",
        "how long it lasts",
        0.05,
        600.0,
        5.0,
        0.1,
        typical,
        kind=ParameterKind.DURATION,
        step_limit=3.0,
        operator_sigma=operator_sigma,
    )


def ramp_fraction(typical: float) -> Parameter:
    """Return the parameter that says how sharp the edges of an event are."""
    return Parameter(
        "rising_share",
        "1",
        "part in which it rises and falls",
        SHARPEST,
        1.0,
        typical,
        0.1,
        typical,
        kind=ParameterKind.EDGE,
        step_limit=0.3,
    )


@dataclass(frozen=True, slots=True)
class Pulse:
    """w(t): (1 - cos)/2 over s T/2, then 1, then down likewise until t0 + T; with s = 1 the gust of load standards."""

    start_s: Scalar
    duration_s: Scalar
    rising_share: Scalar

    @property
    def rise_s(self) -> Scalar:
        """Length of each flank."""
        return self.rising_share * self.duration_s / 2

    @property
    def edges(self) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """Where it starts, is full, falls and ends."""
        end_s = self.start_s + self.duration_s
        return self.start_s, self.start_s + self.rise_s, end_s - self.rise_s, end_s

    def value(self, now: EvaluationContext) -> Scalar:
        """w."""
        begin, full, falls, end = self.edges
        rising = now.is_between(begin, full) * (1 - ca.cos(self._angle(now.time_s - begin))) / 2
        falling = now.is_between(falls, end) * (1 - ca.cos(self._angle(end - now.time_s))) / 2
        return rising + now.is_between(full, falls) + falling

    def slope(self, now: EvaluationContext) -> Scalar:
        """w'; of the sharpest edges nothing, they fall between the samples."""
        begin, full, falls, end = self.edges
        rising = now.is_between(begin, full) * ca.sin(self._angle(now.time_s - begin))
        falling = now.is_between(falls, end) * ca.sin(self._angle(end - now.time_s))
        return (self.rising_share > SHARPEST) * ca.pi / (2 * self.rise_s) * (rising - falling)

    def area(self, now: EvaluationContext) -> Scalar:
        """Of w until now."""
        begin, full, falls, end = self.edges
        rising = now.is_between(begin, full) * self._ramp_integral(now.time_s - begin)
        flat = now.is_between(full, falls) * (now.time_s - begin - self.rise_s / 2)
        whole = self.duration_s - self.rise_s
        falling = now.is_between(falls, end) * (whole - self._ramp_integral(end - now.time_s))
        return rising + flat + falling + now.step_at(end) * whole

    def _angle(self, since_s: Scalar) -> Scalar:
        return ca.pi * since_s / self.rise_s

    def _ramp_integral(self, since_s: Scalar) -> Scalar:
        return (since_s - self.rise_s / ca.pi * ca.sin(self._angle(since_s))) / 2
