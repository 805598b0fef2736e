"""A Butterworth low-pass filter for sample blocks, with its gain and delay, so that both can be corrected.

A linear filter over a block is one matrix, which gives the outputs and the next state from the state and the inputs. A block of
32 samples costs one small product instead of a loop of 32 steps, and needs numpy only.
"""

from functools import lru_cache

import numpy as np

from gateway.numerics.array import Array

MAX_FILTERED_SAMPLES = 64
"""Longer blocks are split, because the matrix grows with the square of the block's length. Basis: a choice; two blocks of a FIFO,
and a matrix of some thousand numbers."""


class LowPass:
    """A digital Butterworth low-pass (bilinear transform, cutoff pre-warped) for the three axes at once."""

    def __init__(self, cutoff_hz: float, order: int, rate_hz: float) -> None:
        """Raises `ValueError` when the cutoff is not inside (0, rate/2) or the order is below 1."""
        if not 0 < cutoff_hz < rate_hz / 2 or order < 1:
            raise ValueError(f"no low-pass of order {order} at {cutoff_hz} Hz for samples at {rate_hz} Hz")
        self.rate_hz = rate_hz
        self._poles = _butterworth_poles(cutoff_hz, order, rate_hz)
        self._system = _state_space(self._poles)
        self._state: Array | None = None
        self._matrix = lru_cache(maxsize=MAX_FILTERED_SAMPLES)(self._block_matrix)

    def restart(self) -> None:
        """Discard the state: the next sample is taken as constant in the past."""
        self._state = None

    def apply(self, values: Array) -> Array:
        """Return the filtered values, shape (n, 3); the state continues from call to call."""
        if self._state is None:
            self._state = self._steady_state(values[0])
        filtered = np.empty_like(values)
        order = len(self._poles)
        for begin in range(0, len(values), MAX_FILTERED_SAMPLES):
            block = values[begin : begin + MAX_FILTERED_SAMPLES]
            both = self._matrix(len(block)) @ np.concatenate([self._state, block])
            self._state = both[:order]
            filtered[begin : begin + MAX_FILTERED_SAMPLES] = both[order:]
        return filtered

    def gain(self, frequency_hz: float) -> float:
        """Return the amplitude ratio at a frequency."""
        return float(abs(self._response(frequency_hz)))

    def delay_s(self, frequency_hz: float = 0.0) -> float:
        """Return the group delay at a frequency: minus the derivative of the phase by the angular frequency."""
        z = np.exp(2j * np.pi * frequency_hz / self.rate_hz)
        # d/dw of arg(1/(1 - p/z)) summed over the poles, minus the zeros at z = -1 with a phase of half a sample each.
        samples = sum(float(np.real((p / z) / (1 - p / z))) for p in self._poles) + len(self._poles) / 2
        return samples / self.rate_hz

    def _response(self, frequency_hz: float) -> complex:
        z = np.exp(2j * np.pi * frequency_hz / self.rate_hz)
        factors = [(1 - p) / 2 * (z + 1) / (z - p) for p in self._poles]
        return complex(np.prod(factors))

    def _steady_state(self, value: Array) -> Array:
        a, b, _, _ = self._system
        return np.asarray(np.linalg.solve(np.eye(len(a)) - a, b[:, None] * value[None, :]), dtype=np.float64)

    def _block_matrix(self, n: int) -> Array:
        """Return the matrix from (state, n inputs) to (next state, n outputs)."""
        a, b, c, d = self._system
        order = len(a)
        matrix = np.zeros((order + n, order + n))
        state = np.hstack([np.eye(order), np.zeros((order, n))])
        for k in range(n):
            matrix[order + k] = c @ state
            matrix[order + k, order + k] += d
            state = a @ state
            state[:, order + k] += b
        matrix[:order] = state
        return matrix


def _butterworth_poles(cutoff_hz: float, order: int, rate_hz: float) -> list[complex]:
    """Return the poles in the z plane, conjugate pairs next to each other."""
    warped = np.tan(np.pi * cutoff_hz / rate_hz)
    angles = np.pi * (2 * np.arange(order) + 1 + order) / (2 * order)
    poles = []
    for angle in angles[: (order + 1) // 2]:
        s = warped * complex(np.cos(angle), np.sin(angle))
        z = (1 + s) / (1 - s)
        poles += [z, z.conjugate()] if abs(s.imag) > 1e-12 * warped else [complex(z.real, 0.0)]
    return poles


def _state_space(poles: list[complex]) -> tuple[Array, Array, Array, float]:
    """Return A, B, C, D of the second-order sections in series, which stay well conditioned unlike a single polynomial."""
    a, b, c, d = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for section in _sections(poles):
        numerator, denominator = section
        m = len(denominator) - 1
        sa = np.zeros((m, m))
        sa[:, 0] = -denominator[1:]
        sa[: m - 1, 1:] = np.eye(m - 1)
        sb = numerator[1:] - denominator[1:] * numerator[0]
        sc = np.eye(m)[0]
        sd = float(numerator[0])
        a = np.block([[a, np.zeros((len(a), m))], [np.outer(sb, c), sa]])
        b, c, d = np.concatenate([b, sb * d]), np.concatenate([sd * c, sc]), sd * d
    return a, b, c, d


def _sections(poles: list[complex]) -> list[tuple[Array, Array]]:
    """Return (numerator, denominator) of each section, with unit gain at zero frequency and zeros at z = -1."""
    sections = []
    remaining = list(poles)
    while remaining:
        pole = remaining.pop(0)
        if pole.imag:
            remaining.pop(0)
            denominator = np.array([1.0, -2 * pole.real, abs(pole) ** 2])
            numerator = np.array([1.0, 2.0, 1.0])
        else:
            denominator = np.array([1.0, -pole.real])
            numerator = np.array([1.0, 1.0])
        sections.append((numerator * denominator.sum() / numerator.sum(), denominator))
    return sections
