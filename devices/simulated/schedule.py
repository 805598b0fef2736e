"""The schedule of the crane's moves: events in time, and the resulting accelerations, forces and rope lengths.

Every event follows one smooth polynomial, so that its value at a time is exactly the same for any other times in the call.
World frame: z up, azimuths from x towards y.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_EDGE_S = 1e-6
"""An event is left out of a call only if it ended this long before, so that rounding at its end has no effect. Basis: a choice;
far above rounding, far below a step."""


@dataclass(frozen=True, slots=True)
class TrolleyMove:
    """A move of the trolley or the bridge: acceleration over `ramp_s`, constant speed, braking over `ramp_s`."""

    start_s: float
    duration_s: float
    ramp_s: float
    speed_m_s: float
    azimuth_rad: float
    caption: str = ""
    """What a spectator sees; empty: nothing worth a line."""


@dataclass(frozen=True, slots=True)
class Gust:
    """A gust of wind that rises and falls smoothly to `force_m_s2`, force per mass of the load."""

    start_s: float
    duration_s: float
    force_m_s2: float
    azimuth_rad: float
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Hoist:
    """A change of the rope's length by `by_m` (shorter: negative)."""

    start_s: float
    duration_s: float
    by_m: float
    caption: str = ""


Event = TrolleyMove | Gust | Hoist


@dataclass(frozen=True, slots=True)
class Drive:
    """Everything that acts on the load at n times."""

    pivot_acceleration_m_s2: Array
    """Shape (n, 3)."""
    force_m_s2: Array
    """Wind on the load, force per mass, shape (n, 3)."""
    length_m: Array
    """Pivot to the load's centre, shape (n, 1), like its two derivatives."""
    length_rate_m_s: Array
    length_acceleration_m_s2: Array


def smooth_step(progress: Array) -> Array:
    """Return a smooth step from 0 at 0 to 1 at 1, with continuous first and second derivatives."""
    return progress**3 * (10 + progress * (6 * progress - 15))


def smooth_step_derivative(progress: Array) -> Array:
    """Return the derivative of `smooth_step`: area 1, peak 1.875."""
    return 30 * (progress * (1 - progress)) ** 2


def smooth_step_second_derivative(progress: Array) -> Array:
    """Return the second derivative of `smooth_step`."""
    return 60 * progress * (1 - progress) * (1 - 2 * progress)


def progress(time_s: Array, start_s: float, duration_s: float) -> Array:
    """Return 0 before the start, 1 after the end, and a linear ramp in between."""
    return np.clip((time_s - start_s) / duration_s, 0.0, 1.0)


def horizontal(azimuth_rad: float) -> Array:
    """Return the horizontal unit vector of an azimuth in the world frame."""
    return np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])


class Schedule:
    """A finite or endless table of events, which is read as time proceeds, with bounded memory."""

    def __init__(self, events: Iterable[Event], length_m: float, wind_m_s2: tuple[float, float] = (0.0, 0.0)) -> None:
        """`events` in the order of their starts, `length_m` before the first event, `wind_m_s2` a steady wind along x and y."""
        self._coming = iter(events)
        self._next = next(self._coming, None)
        self._events: list[Event] = []
        self._length_m = length_m
        self._wind_m_s2 = np.array([*wind_m_s2, 0.0])

    def at(self, time_s: Array) -> Drive:
        """Return everything that acts at increasing times (n,), none before the time given to `prune_past`."""
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
        """Return whether an event of a kind changes something, shape (n,); a trolley at constant speed does not."""
        found = np.zeros(len(time_s), dtype=bool)
        for event in self._acting(time_s):
            if isinstance(event, kind):
                found |= _is_changing(event, time_s)
        return found

    def captions(self, after_s: float, until_s: float) -> list[str]:
        """Return the captions of the events that start between two times, none of them pruned or still to be read."""
        return [event.caption for event in self._events if after_s < event.start_s <= until_s and event.caption]

    def prune_past(self, before_s: float) -> None:
        """Discard events; no earlier time will be requested."""
        while self._events and _has_ended(self._events[0], before_s):
            ended = self._events.pop(0)
            if isinstance(ended, Hoist):
                self._length_m += ended.by_m

    def _acting(self, time_s: Array) -> list[Event]:
        while self._next is not None and self._next.start_s < time_s[-1]:
            self._events.append(self._next)
            self._next = next(self._coming, None)
        return [event for event in self._events if event.start_s < time_s[-1] and not _is_left_out(event, time_s[0])]

    def _length(self, time_s: Array, acting: list[Event]) -> tuple[Array, Array, Array]:
        length, rate, acceleration = np.full_like(time_s, self._length_m), np.zeros_like(time_s), np.zeros_like(time_s)
        for event in acting:
            if isinstance(event, Hoist):
                done = progress(time_s, event.start_s, event.duration_s)
                length += event.by_m * smooth_step(done)
                rate += event.by_m / event.duration_s * smooth_step_derivative(done)
                acceleration += event.by_m / event.duration_s**2 * smooth_step_second_derivative(done)
        return length[:, None], rate[:, None], acceleration[:, None]


def _trolley_m_s2(move: TrolleyMove, time_s: Array) -> Array:
    speeding = smooth_step_derivative(progress(time_s, move.start_s, move.ramp_s))
    slowing = smooth_step_derivative(progress(time_s, move.start_s + move.duration_s - move.ramp_s, move.ramp_s))
    return move.speed_m_s / move.ramp_s * (speeding - slowing)


def _is_changing(event: Event, time_s: Array) -> NDArray[np.bool_]:
    end_s = event.start_s + event.duration_s
    changing: NDArray[np.bool_] = (time_s > event.start_s) & (time_s < end_s)
    if isinstance(event, TrolleyMove):
        changing &= (time_s < event.start_s + event.ramp_s) | (time_s > end_s - event.ramp_s)
    return changing


def _has_ended(event: Event, time_s: float) -> bool:
    return event.start_s + event.duration_s + _EDGE_S < time_s


def _is_left_out(event: Event, time_s: float) -> bool:
    """Return whether an event is left out of the sums; a hoist that has ended remains until it is pruned."""
    return _has_ended(event, time_s) and not isinstance(event, Hoist)
