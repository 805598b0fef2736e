"""The one-pole low-pass: settled at the first sample, also with vibration in the reading."""

import numpy as np
import pytest

from gateway.twin.simulator.first_order_lowpass import first_order_lowpass, lowpass_sensitivity
from tests.gateway.twin.swings import Array

TIME_S = np.arange(0.0, 20.0, 0.02)
SWING_HZ, MACHINE_HZ = 0.16, 12.0
Line = tuple[float, float, float]
"""Amplitude, frequency and phase of a sine."""


def sines(*lines: Line) -> Array:
    total: Array = np.sum([a * np.sin(2 * np.pi * hz * TIME_S + phase) for a, hz, phase in lines], axis=0)[:, None]
    return total


def settled(cutoff_hz: float, *lines: Line) -> Array:
    """Return the exact response after all transients."""
    gain = [(a, hz, phase, 1 / (1 + 1j * hz / cutoff_hz)) for a, hz, phase in lines]
    return sines(*((a * abs(g), hz, phase + np.angle(g)) for a, hz, phase, g in gain))


@pytest.mark.parametrize("phase_rad", [0.0, 0.7, 1.6, 3.0])
def test_lowpass_of_a_swing_is_settled_at_the_first_sample(phase_rad: float) -> None:
    line = (1.0, SWING_HZ, phase_rad)
    found = first_order_lowpass(sines(line), TIME_S, 0.56)
    assert np.abs(found - settled(0.56, line)).max() < 0.03  # begun at the reading itself it is 0.28, at its slope 0.08


def test_vibration_does_not_disturb_the_start_of_the_lowpass() -> None:
    lines = ((1.0, SWING_HZ, 0.7), (0.1, MACHINE_HZ, 0.3))
    found = first_order_lowpass(sines(*lines), TIME_S, 0.56)
    assert np.abs(found - settled(0.56, *lines)).max() < 0.15  # with the slope of the first two samples it is 2


def test_sensitivity_to_the_cutoff_equals_the_difference_quotient() -> None:
    reading = sines((1.0, SWING_HZ, 0.7))
    lagging = first_order_lowpass(reading, TIME_S, 0.56)
    step = 1e-5
    difference = (
        first_order_lowpass(reading, TIME_S, 0.56 + step) - first_order_lowpass(reading, TIME_S, 0.56 - step)
    ) / (2 * step)
    np.testing.assert_allclose(lowpass_sensitivity(reading, lagging, TIME_S, 0.56), difference, atol=1e-6)


def test_samples_of_uneven_spacing_are_filtered_step_by_step() -> None:
    """Between samples the reading is straight, so each step has a closed form."""
    random = np.random.default_rng(2)
    time_s = np.cumsum(random.uniform(0.005, 0.04, 500))
    reading = np.stack([np.sin(time_s), random.normal(size=500)], axis=1)
    found = first_order_lowpass(reading, time_s, 0.56)
    time_constant_s = 1 / (2 * np.pi * 0.56)
    expected = [found[0]]
    for step_s, before, after in zip(np.diff(time_s), reading[:-1], reading[1:], strict=True):
        slope = (after - before) / step_s
        ramp = slope * (step_s - time_constant_s)
        transient = (expected[-1] - before + slope * time_constant_s) * np.exp(-step_s / time_constant_s)
        expected.append(before + ramp + transient)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
