"""The demonstration: hasty and skilled trolley moves, hoisting, a gust and a pause, repeated without end.

A ramp of half a swing period followed by its opposite gives two impulses. Half a period apart they add up; a whole period apart
they cancel. Hasty and skilled moves thus differ in their timing alone, for any rope length.
"""

from collections.abc import Iterator

import numpy as np

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import small_swing_period_s
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Gust, Hoist, TrolleyMove

DAMPING_RATIO = 0.006
FIRST_SWING_RAD = np.radians(1.5)
PUSH_RAD = np.radians(3.7)
"""Swing amplitude from one ramp of a hasty move."""
RAMP_EFFECT = 0.838
"""Amplitude by a smooth ramp of half a period, relative to a step of the same speed: its spectrum at the swing frequency."""
FASTEST_M_S = 4.0


def demo_crane(seed: int, length_m: float, position_m: float, gravity_m_s2: float = STANDARD_GRAVITY_M_S2) -> Crane:
    """Make a crane that swings visibly from the start, exceeds 6 degrees within half a minute, and calms down."""
    random = np.random.default_rng([seed, 0])
    azimuth_rad = random.uniform(-np.pi, np.pi)
    tilt_x_rad, tilt_y_rad = FIRST_SWING_RAD * np.cos(azimuth_rad), FIRST_SWING_RAD * np.sin(azimuth_rad)
    return Crane(
        length_m=length_m,
        position_m=position_m,
        gravity_m_s2=gravity_m_s2,
        events=demo_events(random, length_m, gravity_m_s2),
        motion=start_motion(tilt_x_rad, tilt_y_rad, 0.0, 0.0),
        damping_ratio=DAMPING_RATIO,
    )


def demo_events(random: np.random.Generator, length_m: float, gravity_m_s2: float) -> Iterator[Event]:
    """Yield events without end, in the order of their starts; each round begins and ends with a rope of `length_m`."""
    period_s = small_swing_period_s(length_m, gravity_m_s2)
    push_m_s = PUSH_RAD * gravity_m_s2 * period_s / (2 * np.pi * RAMP_EFFECT)
    heading_rad = random.uniform(-np.pi, np.pi)
    hasty, start_s = True, 1.3 * period_s  # the first swing is measured before the first move
    while True:
        azimuth_rad = heading_rad + random.choice([0.0, np.pi / 2], p=[0.7, 0.3])  # trolley, or bridge
        speed_m_s = min(push_m_s * random.uniform(0.95, 1.1), FASTEST_M_S)
        moves = _hasty_moves if hasty else _skilled_moves
        yield from moves(random, start_s, period_s, speed_m_s, azimuth_rad)
        calm_s = start_s + 6 * period_s
        yield from _hoists_and_gust(random, calm_s, period_s, length_m)
        hasty, start_s = random.random() < 0.4, calm_s + 60 + random.uniform(0, 15)


def _hasty_moves(
    random: np.random.Generator, start_s: float, period_s: float, speed_m_s: float, azimuth_rad: float
) -> Iterator[Event]:
    """Yield a move that leaves the load swinging, and five periods later one back that removes most of the swing."""
    yield TrolleyMove(start_s, period_s, period_s / 2, speed_m_s, azimuth_rad)
    caught = random.uniform(0.75, 0.9)
    yield TrolleyMove(start_s + 5 * period_s, period_s, period_s / 2, -caught * speed_m_s, azimuth_rad)


def _skilled_moves(
    random: np.random.Generator, start_s: float, period_s: float, speed_m_s: float, azimuth_rad: float
) -> Iterator[Event]:
    """Yield a move out and back, each with its two impulses a whole period apart."""
    share = random.uniform(0.4, 1.0)
    for begin_s, signed_m_s in ((start_s, share * speed_m_s), (start_s + 2.2 * period_s, -share * speed_m_s)):
        yield TrolleyMove(begin_s, 1.5 * period_s, period_s / 2, signed_m_s, azimuth_rad)


def _hoists_and_gust(random: np.random.Generator, start_s: float, period_s: float, length_m: float) -> Iterator[Event]:
    """Yield a pause, hoisting up or down, a gust, and hoisting back."""
    by_m = random.choice([-1, 1]) * random.uniform(0.06, 0.12) * length_m
    yield Hoist(start_s + 10, 12, by_m)
    force_m_s2 = random.uniform(0.2, 0.4)
    yield Gust(start_s + 28, random.uniform(0.7, 1.3) * period_s, force_m_s2, random.uniform(-np.pi, np.pi))
    yield Hoist(start_s + 42, 12, -by_m)
