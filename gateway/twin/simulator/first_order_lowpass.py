"""The one-pole low-pass of a sensor, at samples of any spacing, with its sensitivities.

A reading that is straight between two samples is filtered exactly (first-order hold).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]
START_S = 1.5
"""Length of the start to which a polynomial is fitted, in s. Basis: part of a swing, and many periods of a machine."""
DEGREE = 4
"""Degree of this polynomial."""


@dataclass(frozen=True, slots=True)
class _Weights:
    """Weights of one step of the filter, or their derivatives by the cutoff, each of shape (n - 1,)."""

    previous_output: Array
    previous_reading: Array
    reading: Array

    def times(self, output: Array, reading: Array) -> Array:
        """Return the weighted sums for all samples but the first, of columns (n, ...)."""
        return self.previous_output[:, None] * output[:-1] + self.input(reading)

    def input(self, reading: Array) -> Array:
        """Return the part of these sums that comes from the readings."""
        return self.previous_reading[:, None] * reading[:-1] + self.reading[:, None] * reading[1:]


def first_order_lowpass(reading: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Return the filtered reading (n, ...), settled at the first sample as if the reading had always gone on as it starts.

    A one-pole low-pass of time constant T settles to f - T f' + T^2 f'' - ...
    """
    columns = reading.reshape(len(reading), -1)
    weights, _ = _weights(time_s, cutoff_hz)
    first = _powers_of_lag(cutoff_hz) @ _derivatives_at_start(columns, time_s)
    return _recursion(first, weights.previous_output, weights.input(columns)).reshape(reading.shape)


def lowpass_sensitivity(reading: Array, filtered: Array, time_s: Array, cutoff_hz: float) -> Array:
    """Return the derivative of the filtered reading (n, k) by the cutoff, in 1/Hz."""
    weights, weights_by = _weights(time_s, cutoff_hz)
    lags_by = -np.arange(DEGREE + 1) / cutoff_hz * _powers_of_lag(cutoff_hz)
    first = lags_by @ _derivatives_at_start(reading, time_s)
    return _recursion(first, weights.previous_output, weights_by.times(filtered, reading))


def initial_transient(time_s: Array, cutoff_hz: float) -> Array:
    """Return the share of the filter's state at the first sample that remains at each sample, shape (n, 1)."""
    share: Array = np.exp(-2 * np.pi * cutoff_hz * (time_s - time_s[0]))[:, None]
    return share


def _recursion(first: Array, decay: Array, driven: Array) -> Array:
    """Return y with y[0] = first and y[i] = decay[i - 1] y[i - 1] + driven[i - 1]: a bidiagonal system of equations."""
    bands = np.ones((2, len(decay) + 1))
    bands[1, :-1] = -decay
    found: Array = solve_banded((1, 0), bands, np.concatenate([first[None], driven]), check_finite=False)
    return found


def _powers_of_lag(cutoff_hz: float) -> Array:
    """Return the powers 0 to DEGREE of -T."""
    return (-1 / (2 * np.pi * cutoff_hz)) ** np.arange(DEGREE + 1.0)


def _derivatives_at_start(columns: Array, time_s: Array) -> Array:
    """Return the derivatives of the readings (n, k) at the first sample, from order 0, by a polynomial; shape (DEGREE + 1, k)."""
    since = (time_s - time_s[0]) / START_S
    since = since[: max(2 * DEGREE, int(np.searchsorted(since, 1.0)))]
    orders = np.arange(DEGREE + 1)
    coefficients = np.linalg.lstsq(since[:, None] ** orders, columns[: len(since)], rcond=None)[0]
    scale = np.array([math.factorial(order) for order in orders]) / START_S**orders
    derivatives: Array = scale[:, None] * coefficients
    return derivatives


def _weights(time_s: Array, cutoff_hz: float) -> tuple[_Weights, _Weights]:
    """Return the weights of each step, and their derivatives by the cutoff."""
    step_s, omega = np.diff(time_s), 2 * np.pi * cutoff_hz
    decay = np.exp(-omega * step_s)
    mean = -np.expm1(-omega * step_s) / (omega * step_s)
    decay_by, mean_by = 2 * np.pi * -step_s * decay, 2 * np.pi * (decay - mean) / omega
    return _Weights(decay, mean - decay, 1 - mean), _Weights(decay_by, mean_by - decay_by, -mean_by)
