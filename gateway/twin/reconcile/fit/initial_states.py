"""Initial states that the samples show: of a large swing's windows from two samples each, near the load from harmonics.

Windows are about two periods long, and angles above 90 degrees are included. At the load the readings across the rope hardly show
the swing: the rope's force shows it, at twice the swing's frequency. With the load's displacement over the rope's length
Re(X exp(i w t)) and a housing at rho (Łuczak et al. 2022, section 8, inverted)

    f_x,y = (1 - rho) u - drag        f_z = 1 + (rho/2 - 1/4) |X|^2 - (rho/2 + 1/4) Re(X . X exp(2 i w t))
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.data_checks import MIN_PERIODS
from gateway.twin.reconcile.data.observations import Observations, local_amplitude_rad
from gateway.twin.simulator.state import ROPE_RATES, ROPE_TILTS

LOWEST_POINT_SEARCH_PERIODS = 0.55
"""Length of the interval, in periods, in which a lowest point is searched: there are two in each period."""
Array = NDArray[np.float64]
RATE_INTERVAL_PERIODS = 0.02
"""Interval over which the difference of two readings gives a rate, in periods."""
MIN_COSINE = 0.3
"""Least |cosine| of the rope's angle by which the rate of the azimuth is divided: nearer to the horizontal it shows little."""
Complex = NDArray[np.complex128]
WINDOW_PERIODS = 3.0
"""Length of the interval, from the start of a segment, in which the harmonics are fitted."""
VISIBLE_SIGMA = 5.0
"""Standard uncertainties from which a harmonic is used."""
MIN_AXIS_RATIO = 0.05
"""Least minor over major axis that a fit starts from: from a planar swing it finds no other, because the slope is zero there."""
LARGEST_HORIZONTAL = 0.99
"""Horizontal part of the rope's direction that a fit starts from at most: 82 degrees."""
LARGEST_CHORD = 1.9
"""Of an amplitude, 2 sin(amplitude/2): 144 degrees."""


def window_bounds(rig: TwinRig, observations: Observations) -> list[int]:
    """Return the first samples of windows of about two periods.

    All but the first begin at a lowest point, where the samples determine the initial state well.
    """
    period_s = swing_period_s(rig, observations)
    count = max(1, round(observations.duration_s / (MIN_PERIODS * period_s)))
    first_samples = {0}
    for nominal_s in observations.duration_s * np.arange(1, count) / count:
        distance_s = np.abs(observations.time_s - nominal_s)
        near = np.flatnonzero(distance_s < LOWEST_POINT_SEARCH_PERIODS / 2 * period_s)
        first_samples.add(int(near[np.argmax(observations.force_g[near, 2])]))
    return sorted(first_samples)


def swing_period_s(rig: TwinRig, observations: Observations) -> float:
    """Return the nominal period at the recording's amplitude."""
    return rig.small_swing_period_s * period_ratio(observations.amplitude_rad)


def initial_state_from_samples(
    rig: TwinRig, observations: Observations, first_samples: Sequence[int], n_states: int
) -> Array:
    """Return the tilts and rates that the readings show at the first samples of windows, shape (windows, states).

    The heading is 0: the housing's x axis is the one across the rope that is nearest to the world's.
    """
    initial_states = np.zeros((len(first_samples), n_states))
    ahead = max(1, int(np.searchsorted(observations.time_s, RATE_INTERVAL_PERIODS * swing_period_s(rig, observations))))
    at = np.minimum(np.array(first_samples), len(observations.time_s) - 1 - ahead)
    upward, upward_ahead = (_upward(rig, observations, each) for each in (at, at + ahead))
    elapsed_s = observations.time_s[at + ahead] - observations.time_s[at]
    rates = _rates_across(upward, (upward_ahead - upward) / elapsed_s[:, None])
    initial_states[:, ROPE_TILTS], initial_states[:, ROPE_RATES] = _tilts_and_rates(upward, rates)
    return initial_states


def _upward(rig: TwinRig, observations: Observations, at: NDArray[np.int_]) -> Array:
    """Return the vertical in the housing's axes at some samples (k,), which a housing at the pivot would read, shape (k, 3).

    A free swing reads (1 - p/L) sin(angle) across the rope, in g, and along it cos(angle) and the centripetal acceleration, which
    by the energy of a swing from amplitude A is 2 (p/L) (cos(angle) - cos A). The angle is that of both, so that it may exceed 90
    degrees, and at most A: where the stated length is wrong, the reading across the rope alone may exceed any sine.
    """
    share = rig.position_m / rig.length_m
    across = observations.force_g[at, :2] / (1 - share)
    sine = np.hypot(*across.T)
    if observations.has_large_amplitude:
        amplitude_rad = observations.amplitude_rad
        cosine = (observations.force_g[at, 2] + 2 * share * np.cos(amplitude_rad)) / (1 + 2 * share)
        angle_rad = np.minimum(np.arctan2(sine, cosine), amplitude_rad)
    else:
        angle_rad = np.arcsin(np.minimum(sine, 1.0))
    direction = across / np.maximum(sine, 1e-12)[:, None]
    return np.column_stack([np.sin(angle_rad)[:, None] * direction, np.cos(angle_rad)])


def _rates_across(upward: Array, rate_1_s: Array) -> Array:
    """Return the rate of the rope's direction along the housing's x and y axes, shape (k, 2), for a housing that does not spin.

    With u the vertical across the rope and c along it, u' = c r and c' = -u·r, so that c u' - u c' is r in the swing's plane.
    """
    across, cosine = upward[:, :2], upward[:, 2:]
    sine = np.linalg.norm(across, axis=1, keepdims=True)
    direction = np.where(sine > MIN_COSINE, across / np.maximum(sine, 1e-12), 0.0)
    along = ((cosine * rate_1_s[:, :2] - across * rate_1_s[:, 2:]) * direction).sum(axis=1, keepdims=True)
    beside = rate_1_s[:, :2] - (rate_1_s[:, :2] * direction).sum(axis=1, keepdims=True) * direction
    divisor = np.where(np.abs(cosine) > MIN_COSINE, cosine, np.where(cosine < 0, -MIN_COSINE, MIN_COSINE))
    rates: Array = along * direction + beside / divisor
    return rates


def _tilts_and_rates(upward: Array, rates: Array) -> tuple[Array, Array]:
    """Return the tilts toward the world's x and y, and their rates, shape (k, 2) each, at heading 0.

    The vertical is (n_x c/s, n_y/s, c) there, with the rope's direction n, c = -n_z and s² = 1 - n_x².
    """
    across_x, across_y, cosine = upward.T
    side = np.where(cosine < 0, -1.0, 1.0)
    root = np.maximum(np.sqrt(1 - np.minimum(across_y**2, 1.0)), 1e-9)
    n = np.column_stack([side * across_x / root, across_y * np.abs(cosine) / root, -cosine])
    length = np.maximum(np.sqrt(1 - np.minimum(n[:, 0] ** 2, 1.0)), 1e-9)
    x_axis = np.column_stack([length, -n[:, 0] * n[:, 1] / length, -n[:, 0] * n[:, 2] / length])
    return _tilts(n, rates[:, :1] * x_axis + rates[:, 1:] * np.cross(x_axis, n))


def _tilts(n: Array, velocity: Array) -> tuple[Array, Array]:
    """Return the tilts of ropes with directions n (k, 3) that change at this velocity (k, 3), and their rates, (k, 2) each."""
    tilt_x, tilt_y = np.arctan2(n[:, 0], -n[:, 2]), np.arcsin(np.clip(n[:, 1], -1.0, 1.0))
    sin_x, cos_x, sin_y, cos_y = np.sin(tilt_x), np.cos(tilt_x), np.sin(tilt_y), np.cos(tilt_y)
    rate_x = (velocity[:, 0] * cos_x + velocity[:, 2] * sin_x) / np.maximum(cos_y, 1e-9)
    rate_y = -velocity[:, 0] * sin_x * sin_y + velocity[:, 1] * cos_y + velocity[:, 2] * cos_x * sin_y
    return np.column_stack([tilt_x, tilt_y]), np.column_stack([rate_x, rate_y])


@dataclass(frozen=True, slots=True)
class _Swing:
    """A swing at the start of a segment."""

    amplitude_rad: float
    phase_rad: float
    """The tilt is amplitude cos(phase)."""
    rate_1_s: float
    """Angular frequency at this amplitude."""
    azimuth_rad: float | None
    """Direction in the housing's axes; None: the readings across the rope do not show it."""
    axis_ratio: float
    """Minor over major axis, positive where the swing turns from x to y."""


def harmonic_initial_states(
    rig: TwinRig, observations: Observations, first_samples: Sequence[int], n_states: int
) -> Array:
    """Return the tilts and rates at the first samples of segments, shape (segments, states); zero where no swing shows.

    The axial force shows neither the azimuth nor the sign. The readings across the rope give them where they show the swing,
    or a drag, which opposes the motion; elsewhere the swing continues that of the segment before.
    """
    initial_states = np.zeros((len(first_samples), n_states))
    azimuth_rad, before, before_s = 0.0, None, 0.0
    for i, (first, last) in enumerate(pairwise([*first_samples, len(observations.time_s)])):
        swing = _fit_swing(rig, observations, first, last)
        if swing is None:
            continue
        start_s = float(observations.time_s[first])
        if swing.azimuth_rad is not None:
            azimuth_rad = swing.azimuth_rad
        elif before is not None:
            turned_rad = (before.rate_1_s + swing.rate_1_s) / 2 * (start_s - before_s)
            if np.cos(before.phase_rad + turned_rad - swing.phase_rad) < 0:  # it continues with the opposite sign
                azimuth_rad += np.pi
        before, before_s = swing, start_s
        across, across_rate = _horizontal(swing, rig.small_swing_rate_1_s)
        direction = np.exp(1j * azimuth_rad)
        horizontal = np.array([across * direction, across_rate * direction])
        (x, x_rate), (y, y_rate) = horizontal.real, horizontal.imag
        down = np.sqrt(1 - x**2 - y**2)
        n, velocity = np.array([[x, y, -down]]), np.array([[x_rate, y_rate, (x * x_rate + y * y_rate) / down]])
        tilts, rates = _tilts(n, velocity)
        initial_states[i, ROPE_TILTS], initial_states[i, ROPE_RATES] = tilts[0], rates[0]
    return initial_states


def _fit_swing(rig: TwinRig, observations: Observations, first: int, last: int) -> _Swing | None:
    """Return the swing at the start of a segment; None where neither harmonic exceeds the noise."""
    time_s, used = observations.time_s[first:last] - observations.time_s[first], observations.used[first:last]
    chosen = used & (time_s <= WINDOW_PERIODS * rig.small_swing_period_s)
    if chosen.sum() < 4:
        return None
    force_g = observations.force_g[first:last][chosen]
    rate_1_s = rig.small_swing_rate_1_s / period_ratio(local_amplitude_rad(force_g))
    angle = rate_1_s * time_s[chosen]
    (_, across), ([mean_g], [along]) = _harmonic(angle, force_g[:, :2]), _harmonic(2 * angle, force_g[:, 2:])
    u_g = observations.noise_g * np.sqrt(2 / chosen.sum())
    rho = rig.position_m / rig.length_m
    seen_across = bool((np.abs(across) > VISIBLE_SIGMA * u_g[:2]).any())
    direction, sideways = _principal_axis(across)
    if abs(along) > VISIBLE_SIGMA * u_g[2]:
        square = -along / (rho / 2 + 0.25)
        size = max(float(mean_g - 1) / (rho / 2 - 0.25), abs(square))  # |X|^2
        phase_rad = float(np.angle(square)) / 2
        amplitude_rad = 2 * float(np.arcsin(min(np.sqrt((size + abs(square)) / 2), LARGEST_CHORD) / 2))
        if not seen_across:
            axis_ratio = float(np.sqrt((size - abs(square)) / (size + abs(square))))
            return _Swing(amplitude_rad, phase_rad, rate_1_s, None, max(axis_ratio, MIN_AXIS_RATIO))
        relative = sideways * np.exp(-1j * phase_rad)
        is_expected = abs(1 - rho) * amplitude_rad > VISIBLE_SIGMA * float(u_g[:2].mean())
        is_displacement = is_expected or abs(relative.real) > abs(relative.imag)
        agrees = (relative.real > 0) == (rho <= 1) if is_displacement else relative.imag < 0
        azimuth_rad = float(np.angle(direction)) + (0.0 if agrees else np.pi)
        return _Swing(amplitude_rad, phase_rad, rate_1_s, azimuth_rad, _axis_ratio(across, sideways))
    if seen_across and rho != 1:
        displacement = sideways / (1 - rho)
        amplitude_rad = min(float(abs(displacement)), local_amplitude_rad(force_g))
        azimuth_rad, axis_ratio = float(np.angle(direction)), _axis_ratio(across, sideways)
        return _Swing(amplitude_rad, float(np.angle(displacement)), rate_1_s, azimuth_rad, axis_ratio)
    return None


def _harmonic(angle: Array, values_g: Array) -> tuple[Array, Complex]:
    """Return mean and c of values (n, columns) = mean + Re(c exp(i angle)), each of shape (columns,)."""
    basis = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    mean, cosine, sine = np.linalg.lstsq(basis, values_g, rcond=None)[0]
    return mean, cosine - 1j * sine


def _principal_axis(across: Complex) -> tuple[complex, complex]:
    """Return the direction x + iy of the largest motion across the rope, and the phasor along it."""
    x, y = across
    azimuth_rad = 0.5 * float(np.arctan2(2 * (x * np.conj(y)).real, abs(x) ** 2 - abs(y) ** 2))
    return complex(np.exp(1j * azimuth_rad)), complex(np.cos(azimuth_rad) * x + np.sin(azimuth_rad) * y)


def _axis_ratio(across: Complex, sideways: complex) -> float:
    """Return minor over major axis of the ellipse of the readings across the rope, but not zero."""
    ratio = -float((np.conj(across[0]) * across[1]).imag) / abs(sideways) ** 2
    return ratio if abs(ratio) > MIN_AXIS_RATIO else MIN_AXIS_RATIO


def _horizontal(swing: _Swing, small_swing_rate_1_s: float) -> tuple[complex, complex]:
    """Return the horizontal part of the rope's direction and its rate, along the azimuth and across it.

    The rate along it follows from the energy of a pendulum.
    """
    amplitude, phase = swing.amplitude_rad, swing.phase_rad
    tilt, minor = amplitude * np.cos(phase), swing.axis_ratio * np.sin(amplitude)
    energy = max(2 * (np.cos(tilt) - np.cos(amplitude)), 0.0)
    rate = -np.sign(np.sin(phase)) * small_swing_rate_1_s * np.sqrt(energy)
    horizontal = complex(np.sin(tilt), minor * np.sin(phase))
    horizontal *= min(1.0, LARGEST_HORIZONTAL / max(abs(horizontal), 1e-12))
    return horizontal, complex(np.cos(tilt) * rate, minor * swing.rate_1_s * np.cos(phase))
