"""Friction that holds before it slides, against the hysteresis loop of Dahl's law, and against rest."""

import numpy as np
import pytest

from tests.gateway.twin.swings import PERIOD_S, SWING_RATE, Array, at_pivot, peaks, predicted

HOLD_RAD, PRESLIDING_RAD = 5e-4, 0.01
EFFECTS = {"pivot_friction": {"hold_rad": HOLD_RAD, "presliding_rad": PRESLIDING_RAD}}


def swings() -> tuple[Array, Array]:
    """Return the times of the turning points on one side and the angles there, rad."""
    time_s = np.arange(0, 25 * PERIOD_S, 0.01)
    force = predicted(at_pivot(), EFFECTS, [0.1, 0, 0, 0], time_s)
    return peaks(time_s, np.arctan2(force[:, 0], force[:, 2]))


def test_swing_dies_away_by_the_area_of_the_hysteresis_loop() -> None:
    """4 (A - delta) of friction in a swing: A' = -(2/pi) epsilon omega (1 - delta/A)."""
    when, height = swings()
    middle = (height[1:] + height[:-1]) / 2
    expected = -2 / np.pi * HOLD_RAD * SWING_RATE * (1 - PRESLIDING_RAD / middle)
    assert np.diff(height) / np.diff(when) == pytest.approx(expected, rel=0.012)


def test_small_swings_are_quicker_by_the_stiffness_of_the_hysteresis_loop() -> None:
    """In phase with the angle: epsilon/(pi A) of the integral of F cos(phase) over the loop, F = 1 - 2 exp(-s/delta)."""
    when, height = swings()
    phase = np.linspace(0, np.pi, 20001)
    for period_s, a in zip(np.diff(when), (height[1:] + height[:-1]) / 2, strict=True):
        force = -1 + 2 * np.exp(-a * (1 - np.cos(phase)) / PRESLIDING_RAD)
        stiffness = HOLD_RAD / (np.pi * a) * 2 * np.trapezoid(force * np.cos(phase), phase)
        free = 1 - a**2 / 16 + a**4 / 3072
        shift = 2 * np.pi / period_s / SWING_RATE / free - 1
        assert shift == pytest.approx(stiffness / 2, rel=0.06)
