"""Initial guesses of a motion from the harmonics of a window (Łuczak et al. 2022, section 8, inverted for a small swing).

With the load's horizontal displacement over the rope's length Re(X exp(i w t)), X = (X_x, X_y), a housing at rho reads

    f_x,y = l - (1 - rho) u      f_z = 1 + (rho/2 - 1/4) |X|^2 - (rho/2 + 1/4) Re(X . X exp(2 i w t))
"""

import math

import numpy as np

from gateway.swing.fit.harmonics import Harmonics
from gateway.swing.model.motion import PendulumMotion, ShootingGrid
from gateway.swing.model.spherical_pendulum import ComplexArray
from gateway.swing.rig import MountedHousing

LARGEST_START = 0.77
SEEN = 5.0
"""Standard uncertainties that a harmonic must have to be used."""
LEAST_SHARE = 0.02
"""Of the swing that transverse axes show, below which it is not scaled up."""
AXIAL_WITHIN_RHO = 0.3
"""Difference of rho from 1 up to which the axial force is used beside the transverse one."""


def initial_motions(harmonics: Harmonics, rig: MountedHousing, start_s: float, end_s: float) -> list[PendulumMotion]:
    """Return motions over [start, end] with these harmonics, the most likely first; several where the axes are ambiguous."""
    rate_1_s = 2 * np.pi * harmonics.frequency_hz
    return [
        _motion(harmonics, amplitude, rig, rate_1_s, start_s, end_s)
        for amplitude in _amplitudes(harmonics, rig, rate_1_s)
    ]


def _motion(
    harmonics: Harmonics, amplitude: ComplexArray, rig: MountedHousing, rate_1_s: float, start_s: float, end_s: float
) -> PendulumMotion:
    size_squared = float(np.sum(np.abs(amplitude) ** 2))
    length_m = rig.length_of(rate_1_s) * (1 - min(size_squared, 0.3) / 8)  # the period grows by A^2/16
    phase = np.exp(1j * rate_1_s * (start_s - harmonics.middle_s))
    swing, swing_rate = (amplitude * phase).real, (1j * rate_1_s * amplitude * phase).real
    pull = complex(harmonics.mean_g[0], harmonics.mean_g[1])
    u = complex(swing[0], swing[1]) - pull
    u *= min(1.0, LARGEST_START / max(abs(u), 1e-12))
    state = np.array([[u], [-complex(swing_rate[0], swing_rate[1])], [pull]])
    grid = ShootingGrid.covering(start_s, start_s, 2 * np.pi / rate_1_s)
    return PendulumMotion(grid, state, np.array([np.log(length_m), 0.0]), rig.gravity_m_s2).extended(start_s, end_s)


def _amplitudes(harmonics: Harmonics, rig: MountedHousing, rate_1_s: float) -> list[ComplexArray]:
    """Return X, each of shape (2,): from the transverse axes where they show the swing, near the load also from the axial one."""
    length_m = rig.length_of(rate_1_s)
    rho = rig.position_at(length_m) / length_m  # above 1 for a body that swings about a point above its end
    transverse_visible = bool((np.abs(harmonics.amplitude_g) > SEEN * harmonics.u_g)[:2].any())
    transverse = -harmonics.amplitude_g[:2] / math.copysign(max(abs(1 - rho), LEAST_SHARE), 1 - rho)
    if transverse_visible and abs(1 - rho) > AXIAL_WITHIN_RHO:
        return [_limited(transverse)]
    return [_limited(x) for x in ([transverse] if transverse_visible else []) + _from_axial_force(harmonics, rho)]


def _from_axial_force(harmonics: Harmonics, rho: float) -> list[ComplexArray]:
    """Return swings along the azimuth of x and y, with X . X from the axial harmonic and |X|^2 from the mean where it shows.

    The axial force does not show the sign of the swing, nor its sense of rotation.
    """
    square = -harmonics.amplitude_g[2] / (rho / 2 + 0.25)
    mean_slope = rho / 2 - 0.25
    square_size = abs(square)
    size = (
        max((np.linalg.norm(harmonics.mean_g) - 1.0) / mean_slope, square_size)
        if abs(mean_slope) > 0.1
        else square_size
    )
    major = np.sqrt((size + square_size) / 2)
    minor = max(np.sqrt((size - square_size) / 2), 0.02 * major)
    x, y = harmonics.amplitude_g[:2]
    azimuth = 0.5 * np.arctan2(2 * (x * np.conj(y)).real, abs(x) ** 2 - abs(y) ** 2)
    axes = np.array([[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]])
    phase = np.exp(0.5j * np.angle(square))
    senses = (1, -1) if minor > 0.1 * major else (1,)
    return [sign * phase * (axes @ np.array([major, 1j * sense * minor])) for sense in senses for sign in (1, -1)]


def _limited(amplitude: ComplexArray) -> ComplexArray:
    """Return the amplitude, reduced to the largest that a fit starts from."""
    size = float(np.sqrt(np.sum(np.abs(amplitude) ** 2)))
    return amplitude * min(1.0, LARGEST_START / max(size, 1e-12))
