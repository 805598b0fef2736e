"""The demonstration: calm swing, a hasty trolley move, a caught swing, hoisting and gusts, repeated without end.

A ramp of half a swing period followed by its opposite gives two impulses that add up, for any rope length. A move along the
swing, begun at one of its ends, adds to the swing; the opposite move a whole number of periods later cancels it.
"""

from collections.abc import Iterator

import numpy as np

from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_period_s
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Gust, Hoist, TrolleyMove

DEMO_DAMPING_RATIO = 0.006
"""Basis: a choice; a swing loses a third in ten periods, so that something is always seen."""
CALM_SWING_RAD = np.radians(1.8)
"""Basis: a choice; below usual limits, and visible."""
CALM_S = 25.0
"""Shortest calm swing before a hasty move. Basis: a choice; a person sees calm before the next alert."""
PUSH_RAD = np.radians(3.3)
"""Swing amplitude from one ramp of a hasty move, at most. Basis: a choice; two ramps in step exceed usual limits."""
RAMP_EFFECT = 0.835
"""Amplitude by a smooth ramp of half a period, relative to a step of the same speed. Basis: its spectrum at the swing
frequency."""
GUST_EFFECT = 0.462
"""The same for a gust of a whole period, relative to an impulse of the same area. Definition: the spectrum of the gust's shape at
the swing frequency."""
GUST_PEAK = 1.875
"""Peak of a gust, relative to its mean. Definition: of the gust's shape."""
LOWERED_SHARE = 0.25
"""Change of the rope's length by a hoist; unit 1. Basis: a choice; the period changes visibly, by an eighth."""


def demo_crane(
    seed: int,
    length_m: float,
    position_m: float,
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2,
    rest_s: float = 0.0,
) -> Crane:
    """Make a crane that swings calmly from the start, exceeds 6 degrees after half a minute, and calms down.

    With `rest_s` the load first hangs still for that time, and gusts then begin the calm swing.
    """
    random = np.random.default_rng([seed, 0])
    azimuth_rad = random.uniform(-np.pi, np.pi)
    tilt_x_rad, tilt_y_rad = CALM_SWING_RAD * np.cos(azimuth_rad), CALM_SWING_RAD * np.sin(azimuth_rad)
    return Crane(
        length_m=length_m,
        position_m=position_m,
        gravity_m_s2=gravity_m_s2,
        events=demo_events(random, length_m, azimuth_rad, gravity_m_s2, rest_s),
        motion=None if rest_s > 0 else start_motion(tilt_x_rad, tilt_y_rad, 0.0, 0.0),
        damping_ratio=DEMO_DAMPING_RATIO,
    )


def demo_events(
    random: np.random.Generator, length_m: float, azimuth_rad: float, gravity_m_s2: float, rest_s: float = 0.0
) -> Iterator[Event]:
    """Yield events without end, in the order of their starts, for a load let go toward `azimuth_rad`, or at rest for `rest_s`.

    Two gusts at the end of a round, a period apart, leave the calm swing of the next, so that errors do not add up.
    """
    period_s = small_swing_period_s(length_m, gravity_m_s2)
    gust_m_s2 = CALM_SWING_RAD / 2 * GUST_PEAK * gravity_m_s2 / (2 * np.pi * GUST_EFFECT)
    turn_s = 0.0  # a time at which the swing is at its end toward azimuth_rad
    if rest_s > 0:
        yield from _two_gusts(rest_s, period_s, gust_m_s2, azimuth_rad)
        turn_s = rest_s + 1.75 * period_s
    while True:
        calm_periods = np.ceil(CALM_S / period_s + 0.25)  # a gust ends a quarter of a period after turn_s
        move_s = turn_s + calm_periods * period_s
        calm_rad = CALM_SWING_RAD * _decay(calm_periods)
        yield from _hasty_and_catching_moves(move_s, period_s, calm_rad, random, azimuth_rad, gravity_m_s2)
        yield from _hoists(move_s + 5 * period_s, period_s, LOWERED_SHARE * length_m)
        gust_s = move_s + 10 * period_s
        azimuth_rad += random.choice([np.pi / 2, np.pi, -np.pi / 2])
        yield from _two_gusts(gust_s, period_s, gust_m_s2, azimuth_rad)
        turn_s = gust_s + 1.75 * period_s


def _two_gusts(start_s: float, period_s: float, gust_m_s2: float, azimuth_rad: float) -> Iterator[Event]:
    """Yield two gusts a period apart, which leave the calm swing of a load that hung still."""
    yield Gust(start_s, period_s, gust_m_s2, azimuth_rad, "Gust of wind")
    yield Gust(start_s + period_s, period_s, gust_m_s2, azimuth_rad, "Another gust")


def _hasty_and_catching_moves(
    start_s: float,
    period_s: float,
    calm_rad: float,
    random: np.random.Generator,
    azimuth_rad: float,
    gravity_m_s2: float,
) -> Iterator[Event]:
    """Yield a move that adds to the swing, and three periods later the opposite one that cancels it."""
    push_rad = PUSH_RAD * random.uniform(0.9, 1.0)
    caught = (calm_rad * _decay(0.5) + 2 * push_rad) * _decay(3) / (2 * push_rad)
    speed_m_s = push_rad * gravity_m_s2 * period_s / (2 * np.pi * RAMP_EFFECT)
    yield TrolleyMove(start_s, period_s, period_s / 2, speed_m_s, azimuth_rad, "Trolley starts hastily")
    catch_s = start_s + 3 * period_s
    yield TrolleyMove(catch_s, period_s, period_s / 2, -caught * speed_m_s, azimuth_rad, "Operator catches the swing")


def _hoists(start_s: float, period_s: float, by_m: float) -> Iterator[Event]:
    """Yield lowering and hoisting back, with half a period between them."""
    yield Hoist(start_s, 2 * period_s, by_m, f"Lowering {by_m:.2g} m")
    yield Hoist(start_s + 2.5 * period_s, 2 * period_s, -by_m, f"Hoisting {by_m:.2g} m")


def _decay(periods: float) -> float:
    return float(np.exp(-2 * np.pi * DEMO_DAMPING_RATIO * periods))
