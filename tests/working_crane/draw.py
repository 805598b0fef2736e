"""Draws of events one after another, as in ordinary work: some begin before the last swing has settled."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.working_crane.crane import DURATION_S, G_M_S2
from tests.working_crane.events import Drive, Event, Gust, Hoist

HIGHEST_SPEED_M_S = 2.5
LEAST_ROPE = 0.02
"""Rope above the housing that a hoist leaves, in rope lengths."""


@dataclass(slots=True)
class Timeline:
    """The recording as it fills up with events."""

    rng: np.random.Generator
    length_m: float
    above_load_m: float
    events: list[Event]
    end_s: float = 0.0
    """End of what has been drawn."""
    rope_m: float = 0.0
    """Length of the rope after it."""

    @property
    def period_s(self) -> float:
        """Of small free swings at the first length."""
        return float(2 * np.pi * np.sqrt(self.length_m / G_M_S2))

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def signed(self, low: float, high: float) -> float:
        return self.uniform(low, high) * float(self.rng.choice([-1, 1]))

    def azimuth_rad(self) -> float:
        """Along the bridge, along the trolley, or both at once."""
        along, across = 0.0, float(np.pi / 2)
        return float(self.rng.choice([along, across, self.uniform(0, 2 * np.pi)], p=[0.3, 0.35, 0.35]))

    def add(self, event: Event) -> None:
        """Add an event that the next one waits for."""
        self.events.append(event)
        self.end_s = max(self.end_s, event.end_s)

    def pause(self) -> None:
        """Wait for a time that is short in four cases out of ten."""
        self.end_s += self.uniform(0, 3) if self.rng.random() < 0.4 else self.uniform(4, 20)


Part = Callable[[Timeline], None]


def new_timeline(rng: np.random.Generator, length_m: float, above_load_m: float) -> Timeline:
    """Return an empty timeline whose first event may begin at 6 s."""
    timeline = Timeline(rng, length_m, above_load_m, [], rope_m=length_m)
    timeline.end_s = timeline.uniform(6, 22)
    return timeline


def fill(timeline: Timeline, parts: tuple[Part, ...], probabilities: tuple[float, ...]) -> tuple[Event, ...]:
    """Draw parts until the recording is full; return their events in order of time."""
    while timeline.end_s < DURATION_S - 1:
        parts[int(timeline.rng.choice(len(parts), p=probabilities))](timeline)
        timeline.pause()
    return in_order(timeline.events)


def in_order(events: list[Event]) -> tuple[Event, ...]:
    """Return the events that begin within the recording."""
    return tuple(sorted((e for e in events if e.start_s < DURATION_S), key=lambda event: event.start_s))


def drive(
    timeline: Timeline, mean_m_s2: tuple[float, float] = (0.09, 0.42), top_m_s: float = HIGHEST_SPEED_M_S
) -> Drive:
    """A move whose ramp lasts up to a period."""
    ramp_s = timeline.uniform(0.26, 1.0) * timeline.period_s
    speed = min(timeline.uniform(*mean_m_s2) * ramp_s, top_m_s) * float(timeline.rng.choice([-1, 1]))
    hold_s = timeline.uniform(0, 1.5) * timeline.period_s
    move = Drive(timeline.end_s, ramp_s, hold_s, speed, timeline.azimuth_rad())
    timeline.add(move)
    return move


def driving(timeline: Timeline) -> None:
    """A move, in one case out of five with a hoist that begins during its first ramp."""
    start_s = timeline.end_s
    drive(timeline)
    if timeline.rng.random() < 0.2:
        hoist(timeline, start_s + timeline.uniform(0.2, 2.0))


def driving_without_hoist(timeline: Timeline) -> None:
    drive(timeline)


def hoisting(timeline: Timeline) -> None:
    hoist(timeline, timeline.end_s)


def hoist(timeline: Timeline, start_s: float) -> None:
    """A hoist at a mean speed of 0.1 to 0.5 m/s, of at least 4 s."""
    by_m = hoist_m(timeline)
    duration_s = max(4.0, abs(by_m) / timeline.uniform(0.1, 0.5))
    timeline.add(Hoist(start_s, duration_s, by_m))


def hoist_m(timeline: Timeline) -> float:
    """Draw a change of length and keep account; the housing stays below the pivot and the length within a third of the first."""
    by_m = timeline.signed(0.045, 0.18) * timeline.length_m
    least_m = max(timeline.above_load_m + LEAST_ROPE * timeline.length_m, 0.7 * timeline.length_m)
    if timeline.rope_m + by_m < least_m or timeline.rope_m + by_m > 1.3 * timeline.length_m:
        by_m = -by_m
    timeline.rope_m += by_m
    return by_m


def gust(timeline: Timeline) -> None:
    """A gust of 0.2 to 0.6 deg; one out of ten still blows when the next event begins."""
    duration_s = timeline.uniform(0.7, 1.9) * timeline.period_s
    azimuth = float(timeline.rng.choice([0.0, np.pi / 2])) + float(timeline.rng.normal(0, 0.15))
    if timeline.rng.random() < 0.55:
        azimuth = timeline.uniform(0, 2 * np.pi)
    blowing = Gust(timeline.end_s, duration_s, timeline.uniform(0.03, 0.11), azimuth % (2 * np.pi))
    timeline.add(blowing)
    if timeline.rng.random() < 0.1:
        timeline.end_s = blowing.start_s + timeline.uniform(0.6, 1.0) * duration_s


ORDINARY: tuple[Part, ...] = (driving, hoisting, gust)
ORDINARY_SHARES = (0.71, 0.14, 0.15)
WITHOUT_HOIST: tuple[Part, ...] = (driving_without_hoist, gust)
WITHOUT_HOIST_SHARES = (0.75, 0.25)
