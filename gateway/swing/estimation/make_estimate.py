"""A finding turned into an estimate."""

import numpy as np

from gateway.numerics.runs import true_runs
from gateway.swing.estimate import SLOWEST_HOIST_M_S, SURE, PeakPrediction, SwingEstimate, SwingPeak
from gateway.swing.estimation.robust_fit import FitResult
from gateway.swing.model.motion import PLAIN, STATES
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.uncertainty.peaks import angles, ellipse, half_swing_peaks, maxima_s, track
from gateway.swing.uncertainty.uncertainty_model import UncertaintyModel

NOTABLE_WIDENING = 1.5
CHOICE = 1.08
"""Widens the interval: the largest of several nearly equal maxima is chosen, which linear propagation does not know."""
FAINT = 0.2
"""Relative uncertainty from which on the interval reaches down to 0: the angle is no longer linear in what is measured."""
LOOK_S = 0.25
UNSETTLED = "the fit did not settle"
NO_MOTION = "no pendulum motion fits the data"


def assess(finding: FitResult, noise_g: Real, from_s: float, to_s: float) -> SwingEstimate:
    """The estimate of the swing between two times inside the fitted window; no angle where the pendulum does not describe it."""
    if not finding.sound:
        return _invalid_reason(finding, noise_g, from_s, to_s)
    fit, claim = finding.fit, finding.claim
    motion = track(fit, from_s, to_s)
    period_s = fit.motion.period_s
    peaks = half_swing_peaks(fit, claim, from_s, to_s)
    largest = max(peaks, key=lambda peak: peak.phi_max_rad)
    minor_rad, azimuth_rad = ellipse(track(fit, max(from_s, to_s - period_s), to_s))
    pull = complex(motion.pull[-1])
    speed_m_s, speed_u_m_s = _rope_speed(finding, to_s)
    return SwingEstimate(
        from_s=from_s,
        to_s=to_s,
        swinging=True,
        phi_max_rad=largest.phi_max_rad,
        u_rad=largest.u_rad,
        coverage95_rad=coverage(largest, claim),
        minor_phi_max_rad=minor_rad,
        azimuth_rad=azimuth_rad,
        lean_rad=float(np.arctan(abs(pull))),
        lean_u_rad=_lean_deviation(finding),
        lean_azimuth_rad=float(np.angle(pull)),
        period_s=period_s,
        length_m=fit.motion.length_m,
        length_u_m=fit.motion.length_m * claim.length_deviation_rel,
        damping_ratio=fit.motion.damping_ratio,
        rope_speed_m_s=speed_m_s,
        rope_speed_u_m_s=speed_u_m_s,
        swings=full_swings(peaks, from_s, to_s, period_s),
        reduced_chi_square=claim.reduced_chi_square,
        noise_g=_three(noise_g),
        reasons=remarks(finding),
    )


def _invalid_reason(finding: FitResult, noise_g: Real, from_s: float, to_s: float) -> SwingEstimate:
    return SwingEstimate(
        from_s=from_s,
        to_s=to_s,
        swinging=None,
        noise_g=_three(noise_g),
        reduced_chi_square=finding.claim.reduced_chi_square,
        reasons=remarks(finding),
    )


def coverage(peak: SwingPeak, claim: UncertaintyModel) -> tuple[float, float]:
    """The 95 % interval of a peak."""
    half = CHOICE * claim.coverage_factor * peak.u_rad
    low = peak.phi_max_rad - half if peak.u_rad < FAINT * peak.phi_max_rad else 0.0
    return max(0.0, low), min(peak.phi_max_rad + half, np.pi)


def remarks(finding: FitResult) -> tuple[str, ...]:
    """Why a number is missing, or larger in its uncertainty than noise alone would make it."""
    claim = finding.claim
    if not finding.fit.converged:
        return (UNSETTLED,)
    if not claim.describes:
        return (
            "a pendulum does not describe the data: "
            f"{claim.misfit:.0%} of the signal unexplained, reduced chi-square {claim.reduced_chi_square:.3g}",
        )
    said = []
    if finding.widening > NOTABLE_WIDENING or claim.misfit > 0:
        unexplained = f"{claim.misfit:.1%} of the signal unexplained in the swing's band"
        said.append(f"widened: {unexplained}, noise {finding.widening:.1f} times what the sensor makes")
    if finding.explained_by:
        said.append("rig and sensor as stated do not explain the data; this would: " + ", ".join(finding.explained_by))
    if finding.spikes:
        said.append(f"spikes left out: {finding.spikes}")
    return tuple(said)


def full_swings(peaks: list[SwingPeak], from_s: float, to_s: float, period_s: float) -> tuple[SwingPeak, ...]:
    """The largest angle of every full period, oldest first."""
    swings = []
    for number in range(int((to_s - from_s) / period_s + 0.02)):
        begin_s = from_s + number * period_s
        inside = [peak for peak in peaks if begin_s <= peak.time_s < begin_s + period_s]
        if inside:
            swings.append(max(inside, key=lambda peak: peak.phi_max_rad))
    return tuple(swings)


def predict(finding: FitResult, now_s: float) -> PeakPrediction | None:
    """The coming maximum after `now_s`, where the fit's grid reaches it and the fit is sound."""
    fit = finding.fit
    if not finding.sound:
        return None
    end_s = min(now_s + 0.75 * fit.motion.period_s, fit.motion.grid.end_s)
    coming = maxima_s(track(fit, now_s, end_s))
    coming = coming[(coming > now_s) & (coming < end_s)]
    if len(coming) == 0:
        return None
    angle, deviation = angles(fit, finding.claim, coming[:1])
    return PeakPrediction(
        phi_max_rad=float(angle[0]), u_rad=float(deviation[0]), time_to_peak_s=float(coming[0]) - now_s
    )


def _rope_speed(finding: FitResult, time_s: float) -> tuple[float | None, float | None]:
    """L' and its standard uncertainty; None for a rope that was taken to keep its length."""
    if finding.fit.motion.raster is None:
        return None, None
    speed_m_s, u_m_s = _rope_speeds(finding, np.array([time_s]))
    return float(speed_m_s[0]), float(u_m_s[0])


def _rope_speeds(finding: FitResult, time_s: Real) -> tuple[Real, Real]:
    """L' and its standard uncertainty at times, each of shape (n,)."""
    motion = finding.fit.motion
    if motion.raster is None:
        return np.zeros_like(time_s), np.zeros_like(time_s)
    by_speed = motion.raster.rope(time_s, 0.0, np.eye(motion.raster.count)).rate_m_s
    places = slice(STATES + PLAIN, STATES + PLAIN + motion.raster.count)
    variance = np.einsum("ni,ij,nj->n", by_speed, finding.claim.covariance[places, places], by_speed)
    return by_speed @ motion.parameters[PLAIN:], np.sqrt(np.maximum(variance, 0.0))


def hoisting_duration_s(finding: FitResult, from_s: float, to_s: float) -> tuple[tuple[float, float], ...]:
    """When between two times the rope's length surely changes, to a quarter of a second."""
    edges_s = np.arange(from_s, to_s + LOOK_S, LOOK_S)
    speed_m_s, u_m_s = _rope_speeds(finding, (edges_s[:-1] + edges_s[1:]) / 2)
    moves = np.abs(speed_m_s) > np.maximum(SURE * u_m_s, SLOWEST_HOIST_M_S)
    return tuple((float(edges_s[start]), float(edges_s[stop])) for start, stop in true_runs(moves))


def _lean_deviation(finding: FitResult) -> float:
    """Along the lean's own direction, or the larger one where there is none."""
    covariance = finding.claim.covariance[4:STATES, 4:STATES]
    pull = finding.fit.motion.nodes[2, 0]
    if abs(pull) < 2 * np.sqrt(covariance.trace()):
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    direction = np.array([pull.real, pull.imag]) / abs(pull)
    return float(np.sqrt(direction @ covariance @ direction))


def _three(noise_g: Real) -> tuple[float, float, float]:
    return float(noise_g[0]), float(noise_g[1]), float(noise_g[2])
