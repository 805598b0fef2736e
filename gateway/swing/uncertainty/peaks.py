"""The rope's largest angles along a fitted motion, with their uncertainties, and the ellipse of the swing."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.estimate import SwingPeak
from gateway.swing.fit.gauss_newton import SwingFit
from gateway.swing.model.spherical_pendulum import ComplexArray, equilibrium, rope_angle
from gateway.swing.uncertainty.uncertainty_model import UncertaintyModel

PEAK_SAMPLES_PER_PERIOD = 48


@dataclass(frozen=True, slots=True)
class AngleSeries:
    """Rope angle along a motion, on a fine grid."""

    time_s: Array
    angle_rad: Array
    displacement: ComplexArray
    """Angle in the direction of gravity in the housing, about the equilibrium, in rad: the swing without the lean."""
    pull: ComplexArray


def sample_angles(fit: SwingFit, from_s: float, to_s: float) -> AngleSeries:
    """Sample the motion between two times inside its grid."""
    count = max(8, int(np.ceil((to_s - from_s) / fit.motion.period_s * PEAK_SAMPLES_PER_PERIOD)) + 1)
    time_s = np.linspace(from_s, to_s, count)
    state = fit.linearised.states(fit.motion.grid.locate(time_s))[..., 0]
    q, pull = state[:, 0], state[:, 2]
    return AngleSeries(time_s, rope_angle(q), _directed_angle(q) - _directed_angle(equilibrium(pull)), pull)


def _directed_angle(q: ComplexArray) -> ComplexArray:
    directed: ComplexArray = rope_angle(q) * np.exp(1j * np.angle(q))
    return directed


def maxima_s(series: AngleSeries) -> Array:
    """Return the times of the local maxima of the angle, including an end from which the angle falls."""
    a = series.angle_rad
    rises, falls = np.diff(a) > 0, np.diff(a) <= 0
    inner = np.flatnonzero(rises[:-1] & falls[1:]) + 1
    ends = [place for place, is_maximum in ((0, falls[0]), (len(a) - 1, rises[-1])) if is_maximum]
    top = np.sort(np.concatenate([inner, ends])).astype(np.intp)
    centre = np.clip(top, 1, len(a) - 2)
    left, middle, right = a[centre - 1], a[centre], a[centre + 1]
    curvature = np.minimum(left - 2 * middle + right, -1e-300)
    vertex = centre + np.clip(0.5 * (left - right) / curvature, -1.0, 1.0)
    step_s = series.time_s[1] - series.time_s[0]
    times: Array = series.time_s[0] + step_s * np.where(curvature > -1e-299, top, vertex)
    return times


def angles_at(fit: SwingFit, uncertainty: UncertaintyModel, time_s: Array) -> tuple[Array, Array]:
    """Return the rope angle and its standard uncertainty at times, each of shape (n,)."""
    angle_rad, gradient = _angles_and_gradients(fit, time_s)
    pairs = zip(angle_rad, gradient, strict=True)
    return angle_rad, np.array([uncertainty.angle_u_rad(float(a), row) for a, row in pairs])


def _angles_and_gradients(fit: SwingFit, time_s: Array) -> tuple[Array, Array]:
    """Return the rope angle at times, shape (n,), and its derivative by the fitted unknowns, (n, free)."""
    times = fit.motion.grid.locate(time_s)
    variants = fit.linearised.states(times)[:, 0]
    jacobian, _ = fit.linearised.condense(np.stack([variants.real, variants.imag], axis=1), times)
    q = variants[:, 0]
    size = np.maximum(np.abs(q), 1e-12)
    outward = np.stack([q.real, q.imag], axis=1) / (size * (1 + size**2 / 4))[:, None]
    gradient = np.einsum("nc,ncp->np", outward, jacobian)
    whole = np.zeros((len(time_s), len(fit.free)))
    whole[:, : fit.linearised.n_unknowns] = gradient
    return rope_angle(q), whole[:, fit.free]


def half_swing_peaks(fit: SwingFit, uncertainty: UncertaintyModel, from_s: float, to_s: float) -> list[SwingPeak]:
    """Return the largest angle of every half swing between two times, oldest first; at least one."""
    series = sample_angles(fit, from_s, to_s)
    times = maxima_s(series)
    if len(times) == 0:
        times = series.time_s[:1]
    angle, u = angles_at(fit, uncertainty, times)
    return [
        SwingPeak(time_s=float(time_s), phi_max_rad=float(angle_rad), u_rad=float(u_rad))
        for time_s, angle_rad, u_rad in zip(times, angle, u, strict=True)
    ]


def largest_angle(fit: SwingFit, uncertainty: UncertaintyModel) -> tuple[float, float]:
    """Return the largest angle in the fitted window and its standard uncertainty."""
    angle, u = angles_at(fit, uncertainty, _time_of_largest_s(fit))
    return float(angle[0]), float(u[0])


def largest_angle_gradient(fit: SwingFit) -> Array:
    """Return the derivative of the largest angle in the fitted window by the fitted unknowns, shape (free,)."""
    gradient: Array = _angles_and_gradients(fit, _time_of_largest_s(fit))[1][0]
    return gradient


def _time_of_largest_s(fit: SwingFit) -> Array:
    times = fit.bins.time_s
    series = sample_angles(fit, float(times[0]), float(times[-1]))
    return series.time_s[[np.argmax(series.angle_rad)]]


def swing_ellipse(series: AngleSeries) -> tuple[float, float]:
    """Return the semi-minor axis, and the azimuth of the major one in (-pi/2, pi/2], in rad, of one period of a motion."""
    square = np.mean(series.displacement * series.displacement)
    size = float(np.mean(np.abs(series.displacement) ** 2))
    minor = np.sqrt(max(size - float(np.abs(square)), 0.0))
    azimuth = 0.5 * float(np.angle(square))
    return float(minor), azimuth if azimuth > -np.pi / 2 else np.pi / 2
