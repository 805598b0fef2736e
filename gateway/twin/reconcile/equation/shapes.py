"""Frequencies, time constants and gaps at which terms are tried, from the residual of the model so far.

A force or a motion of the pivot shows as a line at its own frequency. A rotation of the housing or a changing stiffness
multiplies the swing, so its lines stand on both sides of the swing's: the product of residual and swing has the frequency itself.
"""

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.spectrum import ZERO_PADDING, periodogram, refine_frequency
from gateway.twin.effects.coefficients import HIGHEST_FREQUENCY_HZ
from gateway.twin.reconcile.residual.whiteness import noise_floor

Array = NDArray[np.float64]
MAX_FREQUENCIES = 5
PEAKS_OF_A_SIGNAL = 3
"""Frequencies that each product may suggest."""
MIN_PERIODS = 1.4
"""Periods in the recording of the slowest frequency: fewer cannot be told from a drift."""
APART_CYCLES = 0.7
"""Cycles in the recording by which two frequencies differ."""
MIN_POWER_RATIO = 12.0
"""Power over the noise floor from which a peak is tried."""
TIME_CONSTANT_SHARES = (0.03, 0.08, 0.2, 0.5)
"""Time constants over the duration of the recording."""


GAP_SHARES = (0.03, 0.08, 0.16)
"""Half plays over the largest reading across the rope."""
DEAD_ZONE_SHARES = (0.2, 0.4, 0.6, 0.8)
"""Dead zones over the largest displacement of the load."""
OVERTONES = 7
"""Multiples of the swing's frequency at which no periodic term is tried: what keeps time with the swing is made by the swing."""


def shape_choices(time_s: Array, residual: Array, simulated_g: Array, reach_m: float) -> dict[str, list[float]]:
    """Return values of the parameters that give terms their shape, by the parameter's name, the most likely first.

    `residual` (n, 3) in sigma is that of the model so far, `simulated_g` (n, 3) the readings of that model, `reach_m` the largest
    displacement of the load.
    """
    duration_s = float(time_s[-1] - time_s[0])
    across_g = simulated_g[:, :2] - simulated_g[:, :2].mean(axis=0)
    return {
        "frequency_hz": candidate_frequencies_hz(time_s, residual, across_g[:, 0] + 1j * across_g[:, 1]),
        "time_constant_s": [share * duration_s for share in TIME_CONSTANT_SHARES],
        "gap_g": [share * float(np.abs(across_g).max()) for share in GAP_SHARES],
        "dead_zone_m": [share * reach_m for share in DEAD_ZONE_SHARES],
    }


def candidate_frequencies_hz(time_s: Array, residual: Array, swing: NDArray[np.complex128]) -> list[float]:
    """Return frequencies at which a periodic term may act, the most evident first, for readings x + i y of the swing (n,)."""
    duration_s = time_s[-1] - time_s[0]
    own_hz = _strongest_hz(time_s, swing)
    found: list[tuple[float, float]] = []
    for signal in _signals(residual, swing):
        frequency_hz, powers = periodogram(time_s, signal)
        power = powers.sum(axis=1)
        band = (frequency_hz > MIN_PERIODS / duration_s) & (frequency_hz < HIGHEST_FREQUENCY_HZ)
        cycles = np.abs(frequency_hz - own_hz * np.clip(np.round(frequency_hz / own_hz), 1, OVERTONES)) * duration_s
        ratio = np.where(band, power / noise_floor(power), 0.0)
        found += [(height, hz) for height, hz in _peaks(frequency_hz, ratio * (cycles > APART_CYCLES))]
    chosen: list[float] = []
    for _, hz in sorted(found, reverse=True):
        if all(abs(hz - other) > APART_CYCLES / duration_s for other in chosen):
            chosen.append(hz)
    return chosen[:MAX_FREQUENCIES]


def _strongest_hz(time_s: Array, swing: NDArray[np.complex128]) -> float:
    across = np.stack([swing.real, swing.imag], axis=1)
    frequency_hz, power = periodogram(time_s, across)
    return refine_frequency(time_s, across, float(frequency_hz[1:][np.argmax(power[1:].sum(axis=1))]))


def _signals(residual: Array, swing: NDArray[np.complex128]) -> list[Array]:
    """Return the residual, and its products with the swing and with the swing's rate, each (n, m)."""
    rate = np.gradient(swing)
    left = residual[:, 0] + 1j * residual[:, 1]
    products = [left * np.conj(each) / max(float(np.abs(each).std()), 1e-12) for each in (swing, rate)]
    parts = [part[:, None] for product in products for part in (product.real, product.imag)]
    return [residual, *parts]


def _peaks(frequency_hz: Array, ratio: Array) -> list[tuple[float, float]]:
    """Return ratio and frequency of the largest peaks that are evident."""
    largest = np.lib.stride_tricks.sliding_window_view(np.pad(ratio, ZERO_PADDING), 2 * ZERO_PADDING + 1).max(axis=1)
    at = np.flatnonzero((ratio == largest) & (ratio > MIN_POWER_RATIO))
    at = at[np.argsort(-ratio[at])][:PEAKS_OF_A_SIGNAL]
    return [(float(ratio[i]), float(frequency_hz[i])) for i in at]
