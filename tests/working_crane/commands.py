"""The events of a case as functions of time: acceleration of the pivot, hoist, wind, heading of the housing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.blind.mechanics import Array
from tests.working_crane.crane import Crane
from tests.working_crane.events import (
    Drive,
    Event,
    Gust,
    Hoist,
    JibTrolley,
    Luff,
    Slew,
    SteppedHoist,
    Wind,
    unit_vector,
)

Flags = NDArray[np.bool_]

THRESHOLD = 1e-3
"""m/s^2 and m/s: the crane is at work beyond it."""


@dataclass(frozen=True, slots=True)
class Commands:
    """One row per time."""

    time_s: Array
    pivot_m_s2: Array
    """World axes, shape (n, 3)."""
    hoist_m_s2: Array
    hoist_m_s: Array
    wind_m_s2: Array
    """Force on the load per mass, shape (n, 3)."""
    heading_rad: Array
    """Turn of the housing about the rope, from above counterclockwise."""
    unsteady_wind: Flags
    """Whether a gust blows or a wind rises."""

    @property
    def driven(self) -> Flags:
        driven: Flags = np.linalg.norm(self.pivot_m_s2, axis=1) > THRESHOLD
        return driven

    @property
    def hoisting(self) -> Flags:
        return np.abs(self.hoist_m_s) > THRESHOLD


def commands(crane: Crane, events: Sequence[Event], steady_wind_m_s2: tuple[float, float], time_s: Array) -> Commands:
    """Return the sum of all events at these times."""
    pivot = _jib_acceleration(crane, events, time_s)
    wind = np.tile([*steady_wind_m_s2, 0.0], (len(time_s), 1))
    hoist_m_s2, hoist_m_s = np.zeros(len(time_s)), np.zeros(len(time_s))
    unsteady = np.zeros(len(time_s), dtype=bool)
    for event in events:
        if isinstance(event, Drive):
            pivot += np.outer(event.motion.acceleration(time_s), unit_vector(event.azimuth_rad))
        elif isinstance(event, Hoist | SteppedHoist):
            hoist_m_s2 += event.acceleration(time_s)
            hoist_m_s += event.velocity(time_s)
        elif isinstance(event, Gust | Wind):
            force = event.force(time_s)
            wind += np.outer(force, unit_vector(event.azimuth_rad))
            steady = isinstance(event, Wind) & (force > event.accel_m_s2 - THRESHOLD)
            unsteady |= (force > THRESHOLD) & ~steady
    heading = crane.spin_rad_s * time_s + _sum(events, Slew, time_s)[0]
    return Commands(time_s, pivot, hoist_m_s2, hoist_m_s, wind, heading, unsteady)


def _jib_acceleration(crane: Crane, events: Sequence[Event], time_s: Array) -> Array:
    """Return the acceleration of a pivot on a turning jib whose radius and height change, shape (n, 3)."""
    if crane.jib is None:
        return np.zeros((len(time_s), 3))
    angle, angle_rate, angle_accel = _sum(events, Slew, time_s)
    radius, radius_rate, radius_accel = _sum(events, JibTrolley, time_s)
    radius = radius + crane.jib.radius_m
    height_accel = np.zeros(len(time_s))
    if crane.jib.boom_m is not None:
        turned, rate, accel = _sum(events, Luff, time_s)
        sine, cosine = np.sin(crane.jib.elevation_rad + turned), np.cos(crane.jib.elevation_rad + turned)
        radius = radius + crane.jib.boom_m * cosine
        radius_rate = radius_rate - crane.jib.boom_m * rate * sine
        radius_accel = radius_accel - crane.jib.boom_m * (accel * sine + rate**2 * cosine)
        height_accel = crane.jib.boom_m * (accel * cosine - rate**2 * sine)
    outward = radius_accel - radius * angle_rate**2
    sideways = radius * angle_accel + 2 * radius_rate * angle_rate
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.column_stack([outward * cosine - sideways * sine, outward * sine + sideways * cosine, height_accel])


def _sum(
    events: Sequence[Event], kind: type[Slew] | type[JibTrolley] | type[Luff], time_s: Array
) -> tuple[Array, Array, Array]:
    """Return displacement, velocity and acceleration of all events of a kind."""
    motions = [event.motion for event in events if isinstance(event, kind)]
    none = np.zeros(len(time_s))
    return (
        sum((motion.displacement(time_s) for motion in motions), none),
        sum((motion.velocity(time_s) for motion in motions), none),
        sum((motion.acceleration(time_s) for motion in motions), none),
    )
