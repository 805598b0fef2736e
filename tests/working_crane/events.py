"""What the crane and the wind do, each event with the quantities that `case.json` states."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.ramps import Trapezoid, bell, bell_slope, rise, travel


@dataclass(frozen=True, slots=True)
class Travel:
    """A motion from rest to rest, with a ramp up, a constant rate, and the same ramp down."""

    start_s: float
    ramp_s: float
    hold_s: float

    @property
    def rate(self) -> float:
        """The constant rate, m/s or rad/s."""
        raise NotImplementedError

    @property
    def motion(self) -> Trapezoid:
        """The way since the start, m or rad."""
        return Trapezoid(self.start_s, self.ramp_s, self.hold_s, self.rate)

    @property
    def end_s(self) -> float:
        return self.motion.end_s


@dataclass(frozen=True, slots=True)
class Drive(Travel):
    """A move of trolley or bridge in a straight line, along the azimuth."""

    speed_m_s: float
    azimuth_rad: float

    @property
    def rate(self) -> float:
        return self.speed_m_s


@dataclass(frozen=True, slots=True)
class JibTrolley(Travel):
    """A move of the trolley along a jib, outward positive: a change of the radius."""

    speed_m_s: float

    @property
    def rate(self) -> float:
        return self.speed_m_s


@dataclass(frozen=True, slots=True)
class Turn(Travel):
    """A turn of the jib or boom."""

    rate_rad_s: float

    @property
    def rate(self) -> float:
        return self.rate_rad_s


class Slew(Turn):
    """A turn of the jib about the vertical: a change of its azimuth."""


class Luff(Turn):
    """A turn of the boom in its vertical plane, upward positive: a change of its elevation."""


@dataclass(frozen=True, slots=True)
class Hoist:
    """A change of the rope's length without a phase of constant speed; lowering is positive."""

    start_s: float
    duration_s: float
    by_m: float

    @property
    def end_s(self) -> float:
        return self.start_s + self.duration_s

    def acceleration(self, time_s: Array) -> Array:
        return self.by_m / self.duration_s**2 * bell_slope(self._part(time_s))

    def velocity(self, time_s: Array) -> Array:
        return self.by_m / self.duration_s * bell(self._part(time_s))

    def _part(self, time_s: Array) -> Array:
        return (time_s - self.start_s) / self.duration_s


@dataclass(frozen=True, slots=True)
class SteppedHoist:
    """A hoist whose speed takes several values in turn, from 0 back to 0, with short ramps between them."""

    start_s: float
    ramp_s: float
    hold_s: tuple[float, ...]
    speed_m_s: tuple[float, ...]

    @property
    def end_s(self) -> float:
        return self.start_s + sum(self.hold_s) + self.ramp_s

    @property
    def by_m(self) -> float:
        """The change of the rope's length; each hold is counted from the start of one ramp to the start of the next."""
        return float(np.dot(self.speed_m_s, self.hold_s))

    def acceleration(self, time_s: Array) -> Array:
        steps = ((change, bell(part)) for change, part in self._steps(time_s))
        return np.asarray(sum(change / self.ramp_s * shape for change, shape in steps))

    def velocity(self, time_s: Array) -> Array:
        return np.asarray(sum(change * rise(part) for change, part in self._steps(time_s)))

    def displacement(self, time_s: Array) -> Array:
        return np.asarray(sum(change * self.ramp_s * travel(part) for change, part in self._steps(time_s)))

    def _steps(self, time_s: Array) -> list[tuple[float, Array]]:
        edges_s = self.start_s + np.concatenate([[0.0], np.cumsum(self.hold_s)])
        changes = np.diff([0.0, *self.speed_m_s, 0.0])
        return [(float(c), (time_s - edge) / self.ramp_s) for c, edge in zip(changes, edges_s, strict=True)]


@dataclass(frozen=True, slots=True)
class Gust:
    """A force on the load that rises and falls; `accel_m_s2` is its peak per mass."""

    start_s: float
    duration_s: float
    accel_m_s2: float
    azimuth_rad: float

    @property
    def end_s(self) -> float:
        return self.start_s + self.duration_s

    def force(self, time_s: Array) -> Array:
        return self.accel_m_s2 / 1.875 * bell((time_s - self.start_s) / self.duration_s)


@dataclass(frozen=True, slots=True)
class Wind:
    """A force on the load that rises slowly and stays; `accel_m_s2` per mass."""

    start_s: float
    rise_s: float
    accel_m_s2: float
    azimuth_rad: float

    @property
    def end_s(self) -> float:
        return self.start_s + self.rise_s

    def force(self, time_s: Array) -> Array:
        return self.accel_m_s2 * rise((time_s - self.start_s) / self.rise_s)


Event = Drive | JibTrolley | Slew | Luff | Hoist | SteppedHoist | Gust | Wind

NAMES: dict[type[Event], str] = {
    Drive: "drive",
    JibTrolley: "jib_trolley",
    Slew: "slew",
    Luff: "luff",
    Hoist: "hoist",
    SteppedHoist: "stepped_hoist",
    Gust: "gust",
    Wind: "wind",
}


def as_json(event: Event) -> dict[str, Any]:
    """Return the event as `case.json` states it."""
    return {"kind": NAMES[type(event)], **asdict(event)}


def unit_vector(azimuth_rad: float) -> Array:
    """Return the horizontal direction, shape (3,)."""
    return np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
