"""Initial guesses of a motion from the harmonics of a window (Łuczak et al. 2022, section 8, inverted for a small swing).

With the load's horizontal displacement over the rope's length Re(X exp(i w t)), X = (X_x, X_y), a housing at rho reads

    f_x,y = l - (1 - rho) u      f_z = 1 + (rho/2 - 1/4) |X|^2 - (rho/2 + 1/4) Re(X . X exp(2 i w t))
"""

import math

import numpy as np

from devices.pendulum.small_swing import period_ratio
from gateway.swing.fit.harmonics import WIDE_RAD, Harmonics
from gateway.swing.model.motion import PendulumMotion, ShootingGrid
from gateway.swing.model.spherical_pendulum import ComplexArray
from gateway.swing.rig import MountedHousing

MIN_HARMONIC_SIGMA = 5.0
"""Standard uncertainties that a harmonic must have to be used."""
MIN_TRANSVERSE_SHARE = 0.02
"""Least share of the swing that transverse axes show: a smaller one is not scaled up further."""
AXIAL_WITHIN_RHO = 0.3
"""Difference of rho from 1 up to which the axial force is used beside the transverse one."""
_AS_COMPLEX = np.array([1, 1j])


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
    """Return the motion from the last lowest point before the start on, where a swing of any size has the harmonic's phase.

    The amplitude is that of the chord 2 sin(angle/2): a planar swing of any size conserves its square and that of the rate.
    """
    size = float(np.sqrt(np.sum(np.abs(amplitude) ** 2)))
    small_swing_rate_1_s = rate_1_s * period_ratio(2 * math.asin(min(size / 2, 1.0)))
    to_major = 0.5 * float(np.angle(np.sum(amplitude**2)))
    lead = (rate_1_s * (start_s - harmonics.middle_s) + to_major + np.pi / 2) % np.pi
    begin_s = start_s - lead / rate_1_s
    turned = amplitude * np.exp(1j * rate_1_s * (begin_s - harmonics.middle_s))
    chord, rate = turned.real @ _AS_COMPLEX, -small_swing_rate_1_s * (1j * turned).real @ _AS_COMPLEX
    pull = complex(harmonics.mean_g[0], harmonics.mean_g[1])
    state = np.array([[chord / np.sqrt(1 - min(abs(chord) ** 2 / 4, 0.5)) - pull], [rate], [pull]])
    grid = ShootingGrid.covering(begin_s, begin_s, 2 * np.pi / rate_1_s)
    parameters = np.array([np.log(rig.length_of(small_swing_rate_1_s)), 0.0])
    from_lowest = PendulumMotion(grid, state, parameters, rig.gravity_m_s2).extended(begin_s, start_s)
    return from_lowest.extended(start_s, end_s)


def _amplitudes(harmonics: Harmonics, rig: MountedHousing, rate_1_s: float) -> list[ComplexArray]:
    """Return X, each of shape (2,): from the transverse axes where they show the swing, near the load also from the axial one."""
    length_m = rig.length_of(rate_1_s)
    rho = rig.position_at(length_m) / length_m  # above 1 for a body that swings about a point above its end
    transverse_visible = bool((np.abs(harmonics.amplitude_g) > MIN_HARMONIC_SIGMA * harmonics.u_g)[:2].any())
    transverse = -harmonics.amplitude_g[:2] / math.copysign(max(abs(1 - rho), MIN_TRANSVERSE_SHARE), 1 - rho)
    if transverse_visible and abs(1 - rho) > AXIAL_WITHIN_RHO:
        return [_sized(transverse, harmonics)]
    return [
        _sized(x, harmonics) for x in ([transverse] if transverse_visible else []) + _from_axial_force(harmonics, rho)
    ]


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


def _sized(amplitude: ComplexArray, harmonics: Harmonics) -> ComplexArray:
    """Return the amplitude of a wide swing with the size by the axial force, another one reduced to what harmonics can state."""
    size = max(float(np.sqrt(np.sum(np.abs(amplitude) ** 2))), 1e-12)
    if harmonics.largest_angle_rad > WIDE_RAD:
        return amplitude * (2 * math.sin(harmonics.largest_angle_rad / 2) / size)
    return amplitude * min(1.0, WIDE_RAD / size)
