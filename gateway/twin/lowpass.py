"""The one-pole low-pass of `lowpass_lag` on samples at any times, with its sensitivities."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def filtered(reading: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Shape (n, ...) as the reading; started as if it had always been there and the reading's slope were older."""
    after, now, coming = _weights(time_s, cutoff_hz)[0]
    found = np.empty_like(reading)
    found[0] = _settled(reading, time_s, cutoff_hz)
    for i in range(1, len(reading)):
        found[i] = after[i - 1] * found[i - 1] + now[i - 1] * reading[i - 1] + coming[i - 1] * reading[i]
    return found


def by_cutoff(reading: Array, lagging: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Derivative of `filtered` by the cutoff in 1/Hz, shape as the reading."""
    (after, _, _), (after_by, now_by, coming_by) = _weights(time_s, cutoff_hz)
    found = np.zeros_like(reading)
    found[0] = _settled_by_cutoff(reading, time_s, cutoff_hz)
    for i in range(1, len(reading)):
        pushed = after_by[i - 1] * lagging[i - 1] + now_by[i - 1] * reading[i - 1] + coming_by[i - 1] * reading[i]
        found[i] = after[i - 1] * found[i - 1] + pushed
    return found


def _settled(reading: Array, time_s: Array, cutoff_hz: float) -> Array:
    lag_s = 1 / (2 * np.pi * cutoff_hz)
    settled: Array = reading[0] - lag_s * (reading[1] - reading[0]) / (time_s[1] - time_s[0])
    return settled


def _settled_by_cutoff(reading: Array, time_s: Array, cutoff_hz: float) -> Array:
    lag_s = 1 / (2 * np.pi * cutoff_hz)
    by: Array = lag_s / cutoff_hz * (reading[1] - reading[0]) / (time_s[1] - time_s[0])
    return by


def _weights(time_s: Array, cutoff_hz: float) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """Of the last output, the last and the new reading, for a reading that is straight between samples; and by cutoff."""
    step_s, omega = np.diff(time_s), 2 * np.pi * cutoff_hz
    turned = omega * step_s
    after = np.exp(-turned)
    mean = -np.expm1(-turned) / turned
    after_by = -step_s * after
    mean_by = (after - mean) / omega
    by = 2 * np.pi
    return (after, mean - after, 1 - mean), (by * after_by, by * (mean_by - after_by), -by * mean_by)
