"""The one-pole low-pass: as if it had always been there, even with a machine's line in the reading."""

import numpy as np
import pytest

from gateway.twin.simulator.first_order_lowpass import first_order_lowpass, lowpass_sensitivity

TIME_S = np.arange(0.0, 20.0, 0.02)
SWING_HZ, MACHINE_HZ = 0.16, 12.0


def sines(*lines):
    return sum(a * np.sin(2 * np.pi * hz * TIME_S + phase) for a, hz, phase in lines)[:, None]


def settled(cutoff_hz, *lines):
    """The exact response after all transients."""
    gain = [(a, hz, phase, 1 / (1 + 1j * hz / cutoff_hz)) for a, hz, phase in lines]
    return sines(*((a * abs(g), hz, phase + np.angle(g)) for a, hz, phase, g in gain))


@pytest.mark.parametrize("phase_rad", [0.0, 0.7, 1.6, 3.0])
def test_a_swing_is_settled_from_the_first_sample(phase_rad):
    line = (1.0, SWING_HZ, phase_rad)
    found = first_order_lowpass(sines(line), TIME_S, 0.56)
    assert np.abs(found - settled(0.56, line)).max() < 0.03  # begun at the reading itself it is 0.28, at its slope 0.08


def test_a_machine_does_not_disturb_the_start():
    lines = ((1.0, SWING_HZ, 0.7), (0.1, MACHINE_HZ, 0.3))
    found = first_order_lowpass(sines(*lines), TIME_S, 0.56)
    assert np.abs(found - settled(0.56, *lines)).max() < 0.15  # with the slope of the first two samples it is 2


def test_the_derivative_by_the_cutoff_is_that_of_the_whole():
    reading = sines((1.0, SWING_HZ, 0.7))
    lagging = first_order_lowpass(reading, TIME_S, 0.56)
    step = 1e-5
    difference = (
        first_order_lowpass(reading, TIME_S, 0.56 + step) - first_order_lowpass(reading, TIME_S, 0.56 - step)
    ) / (2 * step)
    np.testing.assert_allclose(lowpass_sensitivity(reading, lagging, TIME_S, 0.56), difference, atol=1e-6)
