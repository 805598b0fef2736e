"""Events that rise, stay and fall: their parameters, their shape, and the base class of effects with that shape."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.guess_context import SHARPEST
from gateway.twin.effects.parameter import Parameter, ParameterKind, Symbols, shape

START = "start, since the first sample of the recording"


def start(typical: float, **further: Any) -> Parameter:
    """Return the parameter `start_s`, the time at which an event starts; `further` are other fields of `Parameter`."""
    given = {"typical": typical, "kind": ParameterKind.START, "step_limit": 2.0, **further}
    return shape("start_s", "s", START, (0.0, 1e6), 0.0, **given)


def duration(typical: float, name: str = "duration_s", meaning: str = "duration", **further: Any) -> Parameter:
    """Return the parameter for the duration of an event, or of a part of it."""
    given = {"typical": typical, "kind": ParameterKind.DURATION, "step_limit": 3.0, **further}
    return shape(name, "s", meaning, (0.05, 600.0), 5.0, **given)


def ramp_fraction(typical: float) -> Parameter:
    """Return the parameter `rising_share`, the fraction of an event in which it rises and falls."""
    meaning = "fraction in which it rises and falls"
    return shape("rising_share", "1", meaning, (SHARPEST, 1.0), typical, kind=ParameterKind.EDGE, step_limit=0.3)


@dataclass(frozen=True, slots=True)
class Pulse:
    """The shape w(t) of an event of duration T: it rises as (1 - cos)/2 during s T/2, stays 1, and falls in the same way."""

    start_s: Scalar
    duration_s: Scalar
    ramp_fraction: Scalar

    @property
    def ramp_s(self) -> Scalar:
        """Duration of each ramp."""
        return self.ramp_fraction * self.duration_s / 2

    @property
    def discontinuities_s(self) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """The times at which the pulse starts to rise, is full, starts to fall and ends."""
        end_s = self.start_s + self.duration_s
        return self.start_s, self.start_s + self.ramp_s, end_s - self.ramp_s, end_s

    def value(self, context: EvaluationContext) -> Scalar:
        """Return w."""
        start, full, fall, end = self.discontinuities_s
        rising = context.is_between(start, full) * (1 - ca.cos(self._angle(context.time_s - start))) / 2
        falling = context.is_between(fall, end) * (1 - ca.cos(self._angle(end - context.time_s))) / 2
        return rising + context.is_between(full, fall) + falling

    def slope(self, context: EvaluationContext) -> Scalar:
        """Return the derivative of w by time; 0 for the sharpest ramps, which lie between two samples."""
        start, full, fall, end = self.discontinuities_s
        rising = context.is_between(start, full) * ca.sin(self._angle(context.time_s - start))
        falling = context.is_between(fall, end) * ca.sin(self._angle(end - context.time_s))
        return (self.ramp_fraction > SHARPEST) * ca.pi / (2 * self.ramp_s) * (rising - falling)

    def integral(self, context: EvaluationContext) -> Scalar:
        """Return the integral of w over time."""
        start, full, fall, end = self.discontinuities_s
        rising = context.is_between(start, full) * self._ramp_integral(context.time_s - start)
        flat = context.is_between(full, fall) * (context.time_s - start - self.ramp_s / 2)
        total = self.duration_s - self.ramp_s
        falling = context.is_between(fall, end) * (total - self._ramp_integral(end - context.time_s))
        return rising + flat + falling + context.step_at(end) * total

    def _angle(self, elapsed_s: Scalar) -> Scalar:
        return ca.pi * elapsed_s / self.ramp_s

    def _ramp_integral(self, elapsed_s: Scalar) -> Scalar:
        return (elapsed_s - self.ramp_s / ca.pi * ca.sin(self._angle(elapsed_s))) / 2


class PulseEffect(Effect):
    """Base class of events with the shape of one pulse; its parameters include `start`, `duration` and `ramp_fraction`."""

    transient: ClassVar[bool] = True

    def pulse(self, p: Symbols) -> Pulse:
        """Return the shape of the event."""
        return Pulse(p["start_s"], p["duration_s"], p["rising_share"])

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Return the times at which the pulse starts to rise, is full, starts to fall and ends."""
        return self.pulse(p).discontinuities_s
