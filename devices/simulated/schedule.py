"""What moves the crane: a table of events in time, and the accelerations, forces and rope lengths that they add up to.

Every event follows one smooth profile, a polynomial, so that its value at an instant has the same bits whatever the other
instants of the call are. World frame: z up, azimuths from x to y.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_EDGE_S = 1e-6
"""An event is left out of a call only when it ended this long before: rounding at its very end stays without effect."""


@dataclass(frozen=True, slots=True)
class TrolleyMove:
    """Trolley or bridge: speeds up over `ramp_s`, runs on at `speed_m_s`, slows down over `ramp_s` (half a second or more)."""

    start_s: float
    duration_s: float
    ramp_s: float
    speed_m_s: float
    azimuth_rad: float


@dataclass(frozen=True, slots=True)
class Gust:
    """A push of the wind that rises and falls smoothly to `force_m_s2`, force per mass of the load."""

    start_s: float
    duration_s: float
    force_m_s2: float
    azimuth_rad: float


@dataclass(frozen=True, slots=True)
class Hoist:
    """The rope becomes longer by `by_m` (shorter: negative)."""

    start_s: float
    duration_s: float
    by_m: float


Event = TrolleyMove | Gust | Hoist


@dataclass(frozen=True, slots=True)
class Drive:
    """All that acts on the load at n instants, and what it comes from."""

    pivot_acceleration_m_s2: Array
    """Shape (n, 3)."""
    force_m_s2: Array
    """Wind on the load, force per mass, shape (n, 3)."""
    length_m: Array
    """Pivot to the load's centre, shape (n, 1), as its two derivatives."""
    length_rate_m_s: Array
    length_acceleration_m_s2: Array


def smooth_step(progress: Array) -> Array:
    """From 0 at 0 to 1 at 1 with no jump in the first two derivatives."""
    return progress**3 * (10 + progress * (6 * progress - 15))


def smooth_step_derivative(progress: Array) -> Array:
    """Derivative of `smooth_step`: area 1, peak 1.875."""
    return 30 * (progress * (1 - progress)) ** 2


def bump_rate(progress: Array) -> Array:
    """Second derivative of `smooth_step`."""
    return 60 * progress * (1 - progress) * (1 - 2 * progress)


def progress(time_s: Array, start_s: float, duration_s: float) -> Array:
    """0 before, 1 after, straight in between."""
    return np.clip((time_s - start_s) / duration_s, 0.0, 1.0)


def horizontal(azimuth_rad: float) -> Array:
    """Unit vector in the world."""
    return np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])


class Schedule:
    """An endless or finite table of events, read as time goes on; bounded memory."""

    def __init__(self, events: Iterable[Event], length_m: float, wind_m_s2: tuple[float, float] = (0.0, 0.0)) -> None:
        """Take events in the order of their starts, the rope's length before the first, a steady wind along x and y."""
        self._coming = iter(events)
        self._next = next(self._coming, None)
        self._events: list[Event] = []
        self._length_m = length_m
        self._wind_m_s2 = np.array([*wind_m_s2, 0.0])

    def at(self, time_s: Array) -> Drive:
        """What acts at instants (n,), increasing and not before what `forget` was told."""
        acting = self._acting(time_s)
        pivot = np.zeros((len(time_s), 3))
        force = np.zeros((len(time_s), 3)) + self._wind_m_s2
        for event in acting:
            if isinstance(event, TrolleyMove):
                pivot += _trolley_m_s2(event, time_s)[:, None] * horizontal(event.azimuth_rad)
            elif isinstance(event, Gust):
                pulse = smooth_step_derivative(progress(time_s, event.start_s, event.duration_s)) / 1.875
                force += event.force_m_s2 * pulse[:, None] * horizontal(event.azimuth_rad)
        return Drive(pivot, force, *self._length(time_s, acting))

    def acts(self, kind: type[Event], time_s: Array) -> NDArray[np.bool_]:
        """Whether an event of a kind is changing something, shape (n,); a trolley at constant speed is not."""
        found = np.zeros(len(time_s), dtype=bool)
        for event in self._acting(time_s):
            if isinstance(event, kind):
                found |= _changing(event, time_s)
        return found

    def prune_past(self, before_s: float) -> None:
        """No earlier instant will be asked for."""
        while self._events and _ended(self._events[0], before_s):
            ended = self._events.pop(0)
            if isinstance(ended, Hoist):
                self._length_m += ended.by_m

    def _acting(self, time_s: Array) -> list[Event]:
        while self._next is not None and self._next.start_s < time_s[-1]:
            self._events.append(self._next)
            self._next = next(self._coming, None)
        return [event for event in self._events if event.start_s < time_s[-1] and not _over(event, time_s[0])]

    def _length(self, time_s: Array, acting: list[Event]) -> tuple[Array, Array, Array]:
        length, rate, acceleration = np.full_like(time_s, self._length_m), np.zeros_like(time_s), np.zeros_like(time_s)
        for event in acting:
            if isinstance(event, Hoist):
                done = progress(time_s, event.start_s, event.duration_s)
                length += event.by_m * smooth_step(done)
                rate += event.by_m / event.duration_s * smooth_step_derivative(done)
                acceleration += event.by_m / event.duration_s**2 * bump_rate(done)
        return length[:, None], rate[:, None], acceleration[:, None]


def _trolley_m_s2(move: TrolleyMove, time_s: Array) -> Array:
    speeding = smooth_step_derivative(progress(time_s, move.start_s, move.ramp_s))
    slowing = smooth_step_derivative(progress(time_s, move.start_s + move.duration_s - move.ramp_s, move.ramp_s))
    return move.speed_m_s / move.ramp_s * (speeding - slowing)


def _changing(event: Event, time_s: Array) -> NDArray[np.bool_]:
    end_s = event.start_s + event.duration_s
    changing: NDArray[np.bool_] = (time_s > event.start_s) & (time_s < end_s)
    if isinstance(event, TrolleyMove):
        changing &= (time_s < event.start_s + event.ramp_s) | (time_s > end_s - event.ramp_s)
    return changing


def _ended(event: Event, time_s: float) -> bool:
    return event.start_s + event.duration_s + _EDGE_S < time_s


def _over(event: Event, time_s: float) -> bool:
    """Left out of the sums; a hoist that ended stays in them until it is forgotten."""
    return _ended(event, time_s) and not isinstance(event, Hoist)
