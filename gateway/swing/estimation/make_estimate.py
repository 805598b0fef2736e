"""The estimate of a swing from a fit."""

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import true_runs
from gateway.swing.estimate import DETECTION_SIGMA, MIN_HOIST_M_S, SwingEstimate, SwingPeak
from gateway.swing.estimation.robust_fit import FitResult, inflate_uncertainty
from gateway.swing.model.motion import N_BASE_PARAMETERS, N_STATES
from gateway.swing.uncertainty.peaks import half_swing_peaks, sample_angles, swing_ellipse
from gateway.swing.uncertainty.uncertainty_model import UncertaintyModel

NOTABLE_WIDENING = 1.5
SELECTION_WIDENING = 1.08
"""Widens the interval: the largest of several nearly equal maxima is chosen, which linear propagation does not know."""
SMALL_SWING_U_REL = 0.2
"""Relative uncertainty by the data, beside that of the model, from which on the interval reaches down to 0: the angle is no
longer linear in what is measured."""
GRID_STEP_S = 0.25
REMEDY = "check the housing's position and mount in the rig and --axes, or choose a free swing with --from --to"
NOT_CONVERGED = f"the fit of a pendulum did not converge: {REMEDY}"
NOT_AS_STATED = "rig and sensor as stated do not explain the data"
NO_MOTION = f"no pendulum motion fits the data: {REMEDY}"


def make_estimate(result: FitResult, noise_g: Array, from_s: float, to_s: float) -> SwingEstimate:
    """Return the estimate between two times in the fitted window; without an angle where no pendulum describes the data."""
    if not result.is_valid:
        return _without_angle(result, noise_g, from_s, to_s)
    fit = result.fit
    uncertainty, length_u_m, coverage_rad = _with_rivals(result, from_s, to_s)
    series = sample_angles(fit, from_s, to_s)
    period_s = fit.motion.period_s
    peaks = half_swing_peaks(fit, uncertainty, from_s, to_s)
    largest = max(peaks, key=lambda peak: peak.phi_max_rad)
    minor_rad, azimuth_rad = swing_ellipse(sample_angles(fit, max(from_s, to_s - period_s), to_s))
    pull = complex(series.pull[-1])
    return SwingEstimate(
        from_s=from_s,
        to_s=to_s,
        swinging=True,
        phi_max_rad=largest.phi_max_rad,
        u_rad=largest.u_rad,
        coverage95_rad=coverage_rad,
        minor_phi_max_rad=minor_rad,
        azimuth_rad=azimuth_rad,
        lean_rad=float(np.arctan(abs(pull))),
        lean_u_rad=_lean_u_rad(result),
        lean_azimuth_rad=float(np.angle(pull)),
        period_s=period_s,
        length_m=fit.motion.length_m,
        length_u_m=length_u_m,
        damping_ratio=fit.motion.damping_ratio,
        drag=fit.motion.drag,
        friction_rad=fit.motion.friction_rad,
        swings=full_swings(peaks, from_s, to_s, period_s),
        reduced_chi_square=uncertainty.reduced_chi_square,
        noise_g=_three(noise_g),
        reasons=reasons_of(result),
    )


def _without_angle(result: FitResult, noise_g: Array, from_s: float, to_s: float) -> SwingEstimate:
    return SwingEstimate(
        from_s=from_s,
        to_s=to_s,
        swinging=None,
        noise_g=_three(noise_g),
        reduced_chi_square=result.uncertainty.reduced_chi_square,
        reasons=reasons_of(result),
    )


def coverage_interval(peak: SwingPeak, uncertainty: UncertaintyModel) -> tuple[float, float]:
    """Return the 95 % interval of a peak."""
    half = SELECTION_WIDENING * uncertainty.coverage_factor * peak.u_rad
    is_faint = peak.u_rad**2 > (SMALL_SWING_U_REL**2 + uncertainty.model_u_rel**2) * peak.phi_max_rad**2
    low = 0.0 if is_faint else peak.phi_max_rad - half
    return max(0.0, low), min(peak.phi_max_rad + half, np.pi)


def _with_rivals(result: FitResult, from_s: float, to_s: float) -> tuple[UncertaintyModel, float, tuple[float, float]]:
    """Return the uncertainty that contains the rivals, that of the length, and the interval by all of them together."""
    each_largest = [
        max(half_swing_peaks(each.fit, each.uncertainty, from_s, to_s), key=lambda peak: peak.phi_max_rad)
        for each in (result, *result.rivals)
    ]
    intervals = [
        coverage_interval(peak, each.uncertainty)
        for peak, each in zip(each_largest, (result, *result.rivals), strict=True)
    ]
    angles_rad = np.array([peak.phi_max_rad for peak in each_largest])
    lengths_m = np.array([each.fit.motion.length_m for each in (result, *result.rivals)])
    inflated = inflate_uncertainty(result, float(np.abs(angles_rad / angles_rad[0] - 1).max())).uncertainty
    length_u_rel = np.hypot(inflated.length_u_rel, result.fit.prior.rig.gravity_u_rel)
    length_u_m = np.hypot(lengths_m[0] * length_u_rel, np.abs(lengths_m - lengths_m[0]).max())
    return inflated, float(length_u_m), (min(low for low, _ in intervals), max(high for _, high in intervals))


def reasons_of(result: FitResult) -> tuple[str, ...]:
    """Return why a number is missing, or why its uncertainty is larger than by noise alone."""
    uncertainty = result.uncertainty
    if not result.fit.converged:
        return (NOT_CONVERGED,)
    if not uncertainty.is_adequate:
        return (
            "a pendulum does not describe the data: "
            f"{uncertainty.misfit:.0%} of the signal unexplained, reduced chi-square {uncertainty.reduced_chi_square:.3g}",
        )
    reasons = []
    if result.noise_ratio > NOTABLE_WIDENING or uncertainty.misfit > 0:
        unexplained = f"{uncertainty.misfit:.1%} of the signal unexplained in the swing's band"
        reasons.append(f"wider interval: {unexplained}, residual {result.noise_ratio:.1f} times the sensor's noise")
    if result.sensor_errors:
        errors = ", ".join(result.sensor_errors)
        reasons.append(f"{NOT_AS_STATED}; these errors would: {errors}")
    if result.outliers:
        reasons.append(f"spikes left out: {result.outliers}")
    return tuple(reasons)


def full_swings(peaks: list[SwingPeak], from_s: float, to_s: float, period_s: float) -> tuple[SwingPeak, ...]:
    """Return the largest angle of every full period, oldest first."""
    swings = []
    for number in range(int((to_s - from_s) / period_s + 0.02)):
        begin_s = from_s + number * period_s
        inside = [peak for peak in peaks if begin_s <= peak.time_s < begin_s + period_s]
        if inside:
            swings.append(max(inside, key=lambda peak: peak.phi_max_rad))
    return tuple(swings)


def hoisting_intervals_s(result: FitResult, from_s: float, to_s: float) -> tuple[tuple[float, float], ...]:
    """Return when between two times the rope's length significantly changes, to a quarter of a second."""
    edges_s = np.arange(from_s, to_s + GRID_STEP_S, GRID_STEP_S)
    speed_m_s, u_m_s = _rope_speeds(result, (edges_s[:-1] + edges_s[1:]) / 2)
    moving = np.abs(speed_m_s) > np.maximum(DETECTION_SIGMA * u_m_s, MIN_HOIST_M_S)
    return tuple((float(edges_s[start]), float(edges_s[stop])) for start, stop in true_runs(moving))


def _rope_speeds(result: FitResult, time_s: Array) -> tuple[Array, Array]:
    """Return L' and its standard uncertainty at times, each of shape (n,)."""
    motion = result.fit.motion
    if motion.splines is None:
        return np.zeros_like(time_s), np.zeros_like(time_s)
    by_speed = motion.splines.evaluate(time_s, 0.0, np.eye(motion.splines.count)).rate_m_s
    first = N_STATES + N_BASE_PARAMETERS
    places = slice(first, first + motion.splines.count)
    variance = np.einsum("ni,ij,nj->n", by_speed, result.uncertainty.covariance[places, places], by_speed)
    return by_speed @ motion.parameters[N_BASE_PARAMETERS:], np.sqrt(np.maximum(variance, 0.0))


def _lean_u_rad(result: FitResult) -> float:
    """Return the standard uncertainty of the lean along its own direction, or the larger one where it has none."""
    covariance = result.uncertainty.covariance[4:N_STATES, 4:N_STATES]
    pull = result.fit.motion.nodes[2, 0]
    if abs(pull) < 2 * np.sqrt(covariance.trace()):
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    direction = np.array([pull.real, pull.imag]) / abs(pull)
    return float(np.sqrt(direction @ covariance @ direction))


def _three(noise_g: Array) -> tuple[float, float, float]:
    return float(noise_g[0]), float(noise_g[1]), float(noise_g[2])
