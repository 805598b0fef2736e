"""The one-pole low-pass of `lowpass_lag` on samples at any times, with its sensitivities."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BEGINNING_S, DEGREE = 1.5, 4
"""What a polynomial tells of the reading before the recording: part of a swing, and many turns of a machine."""


def first_order_lowpass(reading: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Shape (n, ...) as the reading; started as if it had always been there and the reading had always gone as at its beginning.

    A one-pole low-pass of time constant T settles to f - T f' + T^2 f'' - ...
    """
    after, now, coming = _weights(time_s, cutoff_hz)[0]
    found = np.empty_like(reading)
    found[0] = np.tensordot(_lags(cutoff_hz), _derivatives(reading, time_s), axes=1)
    for i in range(1, len(reading)):
        found[i] = after[i - 1] * found[i - 1] + now[i - 1] * reading[i - 1] + coming[i - 1] * reading[i]
    return found


def lowpass_sensitivity(reading: Array, lagging: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Derivative of `filtered` by the cutoff in 1/Hz, shape as the reading."""
    (after, _, _), (after_by, now_by, coming_by) = _weights(time_s, cutoff_hz)
    found = np.zeros_like(reading)
    lags_by = -np.arange(DEGREE + 1) / cutoff_hz * _lags(cutoff_hz)
    found[0] = np.tensordot(lags_by, _derivatives(reading, time_s), axes=1)
    for i in range(1, len(reading)):
        pushed = after_by[i - 1] * lagging[i - 1] + now_by[i - 1] * reading[i - 1] + coming_by[i - 1] * reading[i]
        found[i] = after[i - 1] * found[i - 1] + pushed
    return found


def initial_transient(time_s: Array, cutoff_hz: float) -> Array:
    """What is left at each time of a filter's state at the first, shape (n, 1)."""
    found: Array = np.exp(-2 * np.pi * cutoff_hz * (time_s - time_s[0]))[:, None]
    return found


def _lags(cutoff_hz: float) -> Array:
    """Powers of -T."""
    powers: Array = (-1 / (2 * np.pi * cutoff_hz)) ** np.arange(DEGREE + 1.0)
    return powers


def _derivatives(reading: Array, time_s: Array) -> Array:
    """Of the reading at the start, order by order from 0, by a polynomial; shape (DEGREE + 1, ...)."""
    since = (time_s - time_s[0]) / BEGINNING_S
    since = since[: max(2 * DEGREE, int(np.searchsorted(since, 1.0)))]
    orders = np.arange(DEGREE + 1)
    coefficients = np.linalg.lstsq(since[:, None] ** orders, reading[: len(since)].reshape(len(since), -1), rcond=None)[
        0
    ]
    scale = np.array([math.factorial(order) for order in orders]) / BEGINNING_S**orders
    found: Array = (scale[:, None] * coefficients).reshape(DEGREE + 1, *reading.shape[1:])
    return found


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
