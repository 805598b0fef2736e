"""The harmonics of a small swing in a window: x and y at the swing's frequency f, z at 2 f."""

import math
from dataclasses import dataclass, replace

import numpy as np

from devices.pendulum.small_swing import period_ratio, small_swing_rate_1_s
from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.model.spherical_pendulum import ComplexArray
from gateway.swing.rig import MountedHousing

FREQUENCY_SPAN = (0.68, 1.55)
"""Searched, relative to the believed frequency: rope lengths from 0.42 to 2.2 of the belief."""
SEARCHES = (FREQUENCY_SPAN, (0.94, 1.06), (0.99, 1.01))
"""Ranges of frequency that are searched one after the other, each relative to the result of the one before. Basis: the last one
leaves an error of 0.1 %."""
WIDE_RAD = 0.77
"""Amplitude up to which harmonics state size and period of a swing; those of a wider one follow from the axial force. Basis:
their errors grow with its square: 4 % of the period here."""
TURNING_POINT_QUANTILE = 0.01
"""Quantile of the axial force that stands for that at the turning points. Basis: a swing spends more time there than anywhere."""
BELIEF_OF_FREQUENCY = 0.5
"""A relative error of the rope's length is half as large in the frequency."""


@dataclass(frozen=True, slots=True)
class Harmonics:
    """The best-fitting harmonics of a window."""

    frequency_hz: float
    mean_g: Array
    """Shape (3,)."""
    amplitude_g: ComplexArray
    """Of x and y at f and of z at 2 f, shape (3,); the signal is Re(amplitude exp(i w (t - middle)))."""
    u_g: Array
    """Standard uncertainty of a real or imaginary part, shape (3,)."""
    middle_s: float
    gain: float
    """Twice the gain in log-likelihood against a constant signal."""
    axial_gain: float
    """Part of the gain by the axial force, less the cost of the frequency under the prior of the rope's length."""
    largest_angle_rad: float
    """By the axial force at the turning points, where it is the cosine of the angle at every place on the rope."""
    unexplained: float
    """Rms of the residual of the harmonics beyond the noise, over the rms of the signal's variation."""
    noise_share: float
    """Rms of the noise over the rms of the signal's variation."""


def angle_by_axial_force(bins: Bins) -> float:
    """Return the rope's largest angle by the axial force at the turning points; noise makes that of a small swing too large."""
    return float(np.arccos(np.clip(np.quantile(bins.force_g[:, 2], TURNING_POINT_QUANTILE), -1.0, 1.0)))


def find_harmonics(
    bins: Bins,
    noise_g: Array,
    rig: MountedHousing,
    *,
    axial: bool = False,
    span: tuple[float, float] = FREQUENCY_SPAN,
) -> Harmonics:
    """Search a range of frequencies for the most likely harmonics; `noise_g` per sample and axis, shape (3,).

    With `axial`, the axial force alone chooses the frequency: near the load a swing shows in it alone, and the transverse axes
    only add noise. `span`: the searched frequencies, relative to the believed one at this amplitude.
    """
    largest_angle_rad = angle_by_axial_force(bins)
    small_swing_hz = small_swing_rate_1_s(rig.length_m, rig.gravity_m_s2) / (2 * np.pi)
    nominal_hz = small_swing_hz / (period_ratio(largest_angle_rad) if largest_angle_rad > WIDE_RAD else 1.0)
    span_s = float(bins.time_s[-1] - bins.time_s[0])
    tries = int(np.clip(6 * span_s * nominal_hz * (span[1] - span[0]), 12, 400))
    ratio = np.geomspace(*span, tries)
    prior_cost = (np.log(ratio) / (BELIEF_OF_FREQUENCY * rig.length_u_rel)) ** 2
    middle_s = float(bins.time_s.mean())
    angle = 2 * np.pi * nominal_hz * ratio[:, None] * (bins.time_s - middle_s)
    weight = bins.count / bins.count.sum()
    transverse, transverse_gain = _fit_sinusoids(angle, bins.force_g[:, :2], weight)
    axial_fit, axial_variance = _fit_sinusoids(2 * angle, bins.force_g[:, 2:], weight)
    per_sample = noise_g**2 / bins.count.sum()
    with np.errstate(divide="ignore", invalid="ignore"):  # an axis that never changes has no noise; it is named as dead
        axial_gain = axial_variance[:, 0] / per_sample[2]
        gain = (transverse_gain / per_sample[:2]).sum(axis=1) + axial_gain
    best = int(np.argmax((axial_gain if axial else gain) - prior_cost))
    variance = weight @ (bins.force_g - weight @ bins.force_g) ** 2
    noise_variance = noise_g**2 / bins.count.mean()
    left = variance - np.append(transverse_gain[best], axial_variance[best]) - noise_variance
    total = max(float(variance.sum()), 1e-14)
    coefficients = np.concatenate([transverse[best], axial_fit[best]], axis=1)
    return Harmonics(
        frequency_hz=float(nominal_hz * ratio[best]),
        mean_g=coefficients[0],
        amplitude_g=coefficients[1] - 1j * coefficients[2],
        u_g=np.sqrt(2 * per_sample),
        middle_s=middle_s,
        gain=float(gain[best]),
        axial_gain=float(axial_gain[best] - prior_cost[best]),
        largest_angle_rad=largest_angle_rad,
        unexplained=math.sqrt(max(float(left.sum()), 0.0) / total),
        noise_share=math.sqrt(float(noise_variance.sum()) / total),
    )


def refine_harmonics(bins: Bins, noise_g: Array, rig: MountedHousing) -> tuple[Harmonics, float]:
    """Return the harmonics by finer and finer searches, and the length of the rope in m by their frequency."""
    for span in SEARCHES:
        harmonics = find_harmonics(bins, noise_g, rig, span=span)
        rig = replace(rig, length_m=rig.length_of(2 * np.pi * harmonics.frequency_hz))
    return harmonics, rig.length_m


def _fit_sinusoids(angle: Array, values_g: Array, weight: Array) -> tuple[Array, Array]:
    """Fit constant, cosine and sine for each row of angles: coefficients (tries, 3, columns), variance (tries, columns)."""
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    mean = weight @ values_g
    weighted = basis * weight
    normal = weighted @ basis.transpose(0, 2, 1) + 1e-9 * np.eye(3)
    moment = weighted @ (values_g - mean)
    solved = np.linalg.solve(normal, moment)
    explained = (moment * solved).sum(axis=1)
    solved[:, 0] += mean
    return solved, explained
