"""Start values from harmonics: x and y swing at f0, z at 2 f0 (physics of a small swing, 000 sec. 8 read the other way).

With u(t) = Re(X exp(i w t)) a swing of complex amplitudes X = (X_x, X_y), a housing at rho reads

    f_x,y = l - (1 - rho) u      f_z = 1 + (rho/2 - 1/4) |X|^2 - (rho/2 + 1/4) Re(X . X exp(2 i w t))
"""

from dataclasses import dataclass

import numpy as np

from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.swing.data.bins import Bins
from gateway.swing.model.motion import Grid, Motion
from gateway.swing.model.spherical_pendulum import Complex, Real
from gateway.swing.rig import MountedHousing

FREQUENCY_SPAN = (0.68, 1.55)
"""Searched, relative to the believed frequency: rope lengths from 0.42 to 2.2 of the belief."""
LARGEST_START = 0.77
SEEN = 5.0
"""Standard uncertainties that a harmonic must have to be used."""
LEAST_SHARE = 0.02
"""Of the swing that transverse axes show, below which it is not scaled up."""
AXIAL_FROM_RHO = 0.7
BELIEF_OF_FREQUENCY = 0.5
"""A relative error of the rope's length is half as large in the frequency."""


@dataclass(frozen=True, slots=True)
class Harmonics:
    """The best-fitting harmonics of a window."""

    frequency_hz: float
    mean_g: Real
    """Shape (3,)."""
    amplitude_g: Complex
    """Of x and y at f0 and of z at 2 f0, shape (3,); the signal is Re(amplitude exp(i w (t - middle)))."""
    u_g: Real
    """Standard uncertainty of a real or imaginary part, shape (3,)."""
    middle_s: float
    gain: float
    """Twice the gain in log-likelihood against a signal that stands still."""
    axial_gain: float
    """The part of it by the axial force, less what the belief in the rope's length costs."""
    unexplained: float
    """Rms of what the harmonics leave, over rms of what moves."""


def find_harmonics(bins: Bins, noise_g: Real, rig: MountedHousing, *, axial: bool = False) -> Harmonics:
    """Search the frequency span for the harmonics that explain most; `noise_g` per sample and axis, shape (3,).

    `axial`: most of the axial force; near the load a swing shows there alone, and the transverse axes only add noise.
    """
    belief_hz = small_swing_rate_1_s(rig.length_m, rig.gravity_m_s2) / (2 * np.pi)
    span_s = float(bins.time_s[-1] - bins.time_s[0])
    tries = int(np.clip(6 * span_s * belief_hz * (FREQUENCY_SPAN[1] - FREQUENCY_SPAN[0]), 12, 400))
    ratio = np.geomspace(*FREQUENCY_SPAN, tries)
    doubt = (np.log(ratio) / (BELIEF_OF_FREQUENCY * rig.length_u_rel)) ** 2
    middle_s = float(bins.time_s.mean())
    angle = 2 * np.pi * belief_hz * ratio[:, None] * (bins.time_s - middle_s)
    weight = bins.count / bins.count.sum()
    across, gain_across = _fit(angle, bins.force_g[:, :2], weight)
    along, gain_along = _fit(2 * angle, bins.force_g[:, 2:], weight)
    per_sample = noise_g**2 / bins.count.sum()
    axial_gain = gain_along[:, 0] / per_sample[2]
    gain = (gain_across / per_sample[:2]).sum(axis=1) + axial_gain
    best = int(np.argmax((axial_gain if axial else gain) - doubt))
    moving = weight @ (bins.force_g - weight @ bins.force_g) ** 2
    left = moving - np.append(gain_across[best], gain_along[best]) - (noise_g**2 / bins.count.mean())
    coefficients = np.concatenate([across[best], along[best]], axis=1)
    return Harmonics(
        frequency_hz=float(belief_hz * ratio[best]),
        mean_g=coefficients[0],
        amplitude_g=coefficients[1] - 1j * coefficients[2],
        u_g=np.sqrt(2 * per_sample),
        middle_s=middle_s,
        gain=float(gain[best]),
        axial_gain=float(axial_gain[best] - doubt[best]),
        unexplained=float(np.sqrt(max(left.sum(), 0.0) / max(moving.sum(), 1e-14))),
    )


def _fit(angle: Real, values_g: Real, weight: Real) -> tuple[Real, Real]:
    """Constant, cosine and sine per angle row and column: shape (tries, 3, columns), and variance explained (tries, columns)."""
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    mean = weight @ values_g
    weighted = basis * weight
    normal = weighted @ basis.transpose(0, 2, 1) + 1e-9 * np.eye(3)
    moment = weighted @ (values_g - mean)
    solved = np.linalg.solve(normal, moment)
    explained = (moment * solved).sum(axis=1)
    solved[:, 0] += mean
    return solved, explained


def start_motions(harmonics: Harmonics, rig: MountedHousing, start_s: float, end_s: float) -> list[Motion]:
    """Motions over [start, end] that have the harmonics, the likeliest first; several where the axes leave a choice."""
    rate_1_s = 2 * np.pi * harmonics.frequency_hz
    return [
        _motion(harmonics, amplitude, rig, rate_1_s, start_s, end_s)
        for amplitude in _amplitudes(harmonics, rig, rate_1_s)
    ]


def _motion(
    harmonics: Harmonics, amplitude: Complex, rig: MountedHousing, rate_1_s: float, start_s: float, end_s: float
) -> Motion:
    size_squared = float(np.sum(np.abs(amplitude) ** 2))
    length_m = rig.length_of(rate_1_s) * (1 - min(size_squared, 0.3) / 8)  # the period grows by A^2/16
    phase = np.exp(1j * rate_1_s * (start_s - harmonics.middle_s))
    swing, swing_rate = (amplitude * phase).real, (1j * rate_1_s * amplitude * phase).real
    pull = complex(harmonics.mean_g[0], harmonics.mean_g[1])
    u = complex(swing[0], swing[1]) - pull
    u *= min(1.0, LARGEST_START / max(abs(u), 1e-12))
    state = np.array([[u], [-complex(swing_rate[0], swing_rate[1])], [pull]])
    grid = Grid.over(start_s, start_s, 2 * np.pi / rate_1_s)
    return Motion(grid, state, np.array([np.log(length_m), 0.0]), rig.gravity_m_s2).extended(start_s, end_s)


def _amplitudes(harmonics: Harmonics, rig: MountedHousing, rate_1_s: float) -> list[Complex]:
    """X, each of shape (2,): from the transverse axes where they see the swing, near the load also from the axial one."""
    rho = rig.rho_at(rig.length_of(rate_1_s))
    transverse_seen = bool((np.abs(harmonics.amplitude_g) > SEEN * harmonics.u_g)[:2].any())
    across = -harmonics.amplitude_g[:2] / max(1 - rho, LEAST_SHARE)
    if transverse_seen and rho < AXIAL_FROM_RHO:
        return [_limited(across)]
    return [_limited(x) for x in ([across] if transverse_seen else []) + _from_axial(harmonics, rho)]


def _from_axial(harmonics: Harmonics, rho: float) -> list[Complex]:
    """Swings along the azimuth that x and y show, with X . X from the axis and |X|^2 from its mean where that tells it.

    Its sign and its sense of turning do not show in the axis.
    """
    square = -harmonics.amplitude_g[2] / (rho / 2 + 0.25)
    tilt = rho / 2 - 0.25
    size = max((np.linalg.norm(harmonics.mean_g) - 1.0) / tilt, abs(square)) if abs(tilt) > 0.1 else abs(square)
    major = np.sqrt((size + abs(square)) / 2)
    minor = max(np.sqrt((size - abs(square)) / 2), 0.02 * major)
    x, y = harmonics.amplitude_g[:2]
    azimuth = 0.5 * np.arctan2(2 * (x * np.conj(y)).real, abs(x) ** 2 - abs(y) ** 2)
    turned = np.array([[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]])
    phase = np.exp(0.5j * np.angle(square))
    senses = (1, -1) if minor > 0.1 * major else (1,)
    return [sign * phase * (turned @ np.array([major, 1j * sense * minor])) for sense in senses for sign in (1, -1)]


def _limited(amplitude: Complex) -> Complex:
    """No start beyond 50 degrees."""
    size = float(np.sqrt(np.sum(np.abs(amplitude) ** 2)))
    return amplitude * min(1.0, LARGEST_START / max(size, 1e-12))
