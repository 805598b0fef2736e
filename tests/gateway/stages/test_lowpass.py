"""The block filter against scipy's."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, freqz_sos, sosfilt, sosfilt_zi

from gateway.stages.lowpass import LowPass

CASES = [(1.0, 2, 125.0), (1.0, 4, 1000.0), (0.5, 1, 50.0), (5.0, 8, 1000.0), (1.0, 3, 4000.0), (0.2, 2, 100.0)]


def reference(values: NDArray[np.float64], cutoff_hz: float, order: int, rate_hz: float) -> NDArray[np.float64]:
    sos = butter(order, cutoff_hz, fs=rate_hz, output="sos")
    state = sosfilt_zi(sos)[:, :, None] * values[0]
    return np.asarray(sosfilt(sos, values, axis=0, zi=state)[0])


@pytest.mark.parametrize(("cutoff_hz", "order", "rate_hz"), CASES)
def test_the_filter_is_butterworth_for_any_blocks(cutoff_hz: float, order: int, rate_hz: float) -> None:
    values = np.random.default_rng(0).normal([0.0, 0.0, 1.0], 1.0, size=(1000, 3))
    lowpass = LowPass(cutoff_hz, order, rate_hz)
    cuts = [0, 32, 33, 40, 700, 1000]
    filtered = np.concatenate([lowpass.apply(values[a:b]) for a, b in pairwise(cuts)])
    np.testing.assert_allclose(filtered, reference(values, cutoff_hz, order, rate_hz), atol=1e-9)


@pytest.mark.parametrize(("cutoff_hz", "order", "rate_hz"), CASES)
def test_the_stated_gain_is_that_of_the_filter(cutoff_hz: float, order: int, rate_hz: float) -> None:
    frequencies_hz = np.array([0.05, 0.3, 0.7]) * cutoff_hz
    _, response = freqz_sos(butter(order, cutoff_hz, fs=rate_hz, output="sos"), worN=frequencies_hz, fs=rate_hz)
    lowpass = LowPass(cutoff_hz, order, rate_hz)
    np.testing.assert_allclose([lowpass.gain(f) for f in frequencies_hz], np.abs(response), rtol=1e-9)


@pytest.mark.parametrize(("cutoff_hz", "order", "rate_hz"), CASES)
def test_the_stated_delay_is_that_of_the_filter(cutoff_hz: float, order: int, rate_hz: float) -> None:
    """Group delay is minus the slope of the phase; here by a difference of scipy's phase."""
    frequency_hz, step_hz = 0.3 * cutoff_hz, 1e-4 * cutoff_hz
    places = np.array([frequency_hz - step_hz, frequency_hz + step_hz])
    _, response = freqz_sos(butter(order, cutoff_hz, fs=rate_hz, output="sos"), worN=places, fs=rate_hz)
    phase = np.unwrap(np.angle(response))
    delay_s = -(phase[1] - phase[0]) / (2 * np.pi * 2 * step_hz)
    assert LowPass(cutoff_hz, order, rate_hz).delay_s(frequency_hz) == pytest.approx(delay_s, rel=1e-4)


def test_delay_of_a_second_order_filter_is_the_textbook_one() -> None:
    assert LowPass(1.0, 2, 1000.0).delay_s() == pytest.approx(0.225, rel=2e-3)
    assert LowPass(1.0, 4, 1000.0).delay_s() == pytest.approx(0.416, rel=2e-3)


def test_the_filter_starts_and_restarts_without_a_transient() -> None:
    lowpass = LowPass(1.0, 4, 125.0)
    steady = np.tile([0.1, -0.2, 1.0], (50, 1))
    np.testing.assert_allclose(lowpass.apply(steady), steady, atol=1e-12)
    lowpass.restart()
    np.testing.assert_allclose(lowpass.apply(3 * steady), 3 * steady, atol=1e-12)


@pytest.mark.parametrize(("cutoff_hz", "order"), [(0.0, 2), (50.0, 2), (60.0, 2), (1.0, 0), (-1.0, 2)])
def test_impossible_filters_are_refused(cutoff_hz: float, order: int) -> None:
    with pytest.raises(ValueError, match="no low-pass"):
        LowPass(cutoff_hz, order, 100.0)
