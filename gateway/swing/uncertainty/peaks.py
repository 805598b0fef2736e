"""The rope's largest angles along a fitted motion, swing by swing, with their uncertainties."""

from dataclasses import dataclass

import numpy as np

from gateway.swing.estimate import SwingPeak
from gateway.swing.fit.likelihood import Fit
from gateway.swing.model.spherical_pendulum import Complex, Real
from gateway.swing.uncertainty.uncertainty_model import UncertaintyModel

SAMPLES_PER_PERIOD = 48
STEEPEST = 0.999
"""Of sin(angle): where the angle's slope by it is cut off."""


@dataclass(frozen=True, slots=True)
class AngleSeries:
    """Rope angle along the motion, on a fine grid."""

    time_s: Real
    angle_rad: Real
    swing: Complex
    """Direction of gravity about the equilibrium, in the housing: the swing without the lean."""
    pull: Complex


def track(fit: Fit, from_s: float, to_s: float) -> AngleSeries:
    """The motion between two times inside its grid."""
    count = max(8, int(np.ceil((to_s - from_s) / fit.motion.period_s * SAMPLES_PER_PERIOD)) + 1)
    time_s = np.linspace(from_s, to_s, count)
    state = fit.response.states(fit.motion.grid.locate(time_s))[..., 0]
    u, pull = state[:, 0], state[:, 2]
    equilibrium = -pull / np.sqrt(1 + np.abs(pull) ** 2)
    return AngleSeries(time_s, np.arcsin(np.minimum(np.abs(u), 1.0)), u - equilibrium, pull)


def maxima_s(motion: AngleSeries) -> Real:
    """Times of the local maxima of the angle, ends included where the angle falls away from them."""
    a = motion.angle_rad
    rises, falls = np.diff(a) > 0, np.diff(a) <= 0
    inner = np.flatnonzero(rises[:-1] & falls[1:]) + 1
    ends = [place for place, falls_away in ((0, falls[0]), (len(a) - 1, rises[-1])) if falls_away]
    top = np.sort(np.concatenate([inner, ends])).astype(np.intp)
    centre = np.clip(top, 1, len(a) - 2)
    left, middle, right = a[centre - 1], a[centre], a[centre + 1]
    curvature = np.minimum(left - 2 * middle + right, -1e-300)
    vertex = centre + np.clip(0.5 * (left - right) / curvature, -1.0, 1.0)
    step_s = motion.time_s[1] - motion.time_s[0]
    times: Real = motion.time_s[0] + step_s * np.where(curvature > -1e-299, top, vertex)
    return times


def angles(fit: Fit, claim: UncertaintyModel, time_s: Real) -> tuple[Real, Real]:
    """Rope angle and its standard uncertainty at times, each of shape (n,)."""
    angle_rad, slope = _angles(fit, time_s)
    pairs = zip(angle_rad, slope, strict=True)
    return angle_rad, np.array([claim.angle_deviation(float(a), row) for a, row in pairs])


def _angles(fit: Fit, time_s: Real) -> tuple[Real, Real]:
    """Rope angle at times, shape (n,), and its derivative by the free unknowns, (n, free)."""
    instants = fit.motion.grid.locate(time_s)
    local = fit.response.states(instants)[:, 0]
    slope, _ = fit.response.chain(np.stack([local.real, local.imag], axis=1), instants)
    u = local[:, 0]
    size = np.maximum(np.abs(u), 1e-12)
    toward = np.stack([u.real, u.imag], axis=1) / size[:, None]
    gradient = np.einsum("nc,ncp->np", toward, slope) / np.sqrt(1 - np.minimum(size, STEEPEST) ** 2)[:, None]
    whole = np.zeros((len(time_s), len(fit.free)))
    whole[:, : fit.response.unknowns] = gradient
    return np.arcsin(np.minimum(size, 1.0)), whole[:, fit.free]


def half_swing_peaks(fit: Fit, claim: UncertaintyModel, from_s: float, to_s: float) -> list[SwingPeak]:
    """The largest angle of every half swing between two times, oldest first; at least one."""
    motion = track(fit, from_s, to_s)
    times = maxima_s(motion)
    if len(times) == 0:
        times = motion.time_s[:1]
    angle, deviation = angles(fit, claim, times)
    return [
        SwingPeak(time_s=float(t), phi_max_rad=float(a), u_rad=float(u))
        for t, a, u in zip(times, angle, deviation, strict=True)
    ]


def largest_angle(fit: Fit, claim: UncertaintyModel) -> tuple[float, float]:
    """The largest angle in the fitted window and its standard uncertainty."""
    angle, deviation = angles(fit, claim, _when_largest_s(fit))
    return float(angle[0]), float(deviation[0])


def largest_angle_slope(fit: Fit) -> Real:
    """Derivative of the largest angle in the fitted window by the free unknowns, shape (free,)."""
    slope: Real = _angles(fit, _when_largest_s(fit))[1][0]
    return slope


def _when_largest_s(fit: Fit) -> Real:
    times = fit.bins.time_s
    motion = track(fit, float(times[0]), float(times[-1]))
    return motion.time_s[[np.argmax(motion.angle_rad)]]


def ellipse(motion: AngleSeries) -> tuple[float, float]:
    """Semi-minor axis and azimuth of the major one in (-pi/2, pi/2], both in radians, of a stretch of one period."""
    square = np.mean(motion.swing * motion.swing)
    size = float(np.mean(np.abs(motion.swing) ** 2))
    minor = np.sqrt(max(size - float(np.abs(square)), 0.0))
    azimuth = 0.5 * float(np.angle(square))
    return float(minor), azimuth if azimuth > -np.pi / 2 else np.pi / 2
