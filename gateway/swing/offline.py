"""The swing in a whole recording."""

from dataclasses import replace
from typing import TypeGuard

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.foreign_readings import lone_spikes
from gateway.swing.data.bins import BINS_PER_PERIOD, SHARED_BINS, Bins, bin_samples, validated_samples
from gateway.swing.data.input_checks import axially_clipped, effective_noise_g, find_fault, shared_quantisation
from gateway.swing.detection.dead_axis import check_axes
from gateway.swing.detection.rest_detection import (
    MIN_AXIAL_GAIN,
    MIN_FIT_GAIN,
    MIN_GAIN,
    MIN_UNEXPLAINED_RATIO,
    at_rest_estimate,
    irregular_motion_estimate,
    is_below_detection,
    likelihood_gains,
    upper_bound_amplitude,
)
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.consistency import choose_mode
from gateway.swing.estimation.make_estimate import NO_MOTION, make_estimate
from gateway.swing.estimation.robust_fit import (
    MIN_FITTED_BINS,
    FitResult,
    choose_damping,
    choose_fit,
    choose_prior,
    fit_robust,
    fit_robust_from,
    inflate_uncertainty,
)
from gateway.swing.estimation.segmentation import Segmenter, combine_segments, fit_gaps_with_hoisting
from gateway.swing.fit.harmonics import WIDE_RAD, Harmonics, angle_by_axial_force, find_harmonics
from gateway.swing.fit.initial_guess import initial_motions
from gateway.swing.fit.priors import Prior, damped_prior, nominal_prior, relaxed_prior
from gateway.swing.model.motion import PendulumMotion
from gateway.swing.model.mount import turn_upright
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.rig import MountedHousing

FIRST_WINDOW_PERIODS, FIRST_WINDOW_OF_WIDE_PERIODS = 3.0, 2.0
"""First window, in periods of a small swing. Basis: the period of a wide swing falls as it decays, so that harmonics of one
frequency do not describe three periods; from two, drawn swings of up to 140 degrees converge."""
WINDOW_GROWTH = 2.2
MIN_PERIODS = 0.8
MIN_SAMPLES = 8
FIRST_ITERATIONS = 25
NO_EVENT_MISFIT = 0.01
"""Unexplained part of the signal above which the recording is looked through for an event."""
ABANDON_MISFIT = 0.3
"""Unexplained part of the signal at which longer windows are not tried."""
MAX_BESIDE_RAD = np.radians(15.0)
"""Angle between the swing and the plane of two recorded axes. Basis: how well a sensor is turned into the plane by eye."""
NO_Y = "y is not recorded: the load is taken to swing in the plane of x and z, or up to 15 degrees beside it"
GRID_MARGIN_PERIODS = 0.05
"""Share of a period by which a grid reaches beyond the last sample."""


def estimate_swing(
    time_s: Array, specific_force_g: Array, *, rig: MountedHousing, noise_g: float | Array | None = None
) -> SwingEstimate:
    """Return the swing in a recording.

    `time_s`, shape (n,), never falling; `specific_force_g`, shape (n, 3), calibrated and unfiltered, housing frame, in units of
    the site's gravity (hanging at rest: 0, 0, 1). Rows with NaN are left out. `noise_g`: 1 sigma per sample, scalar or per axis.
    Raises `ValueError` for arrays of wrong shape or falling times.
    """
    return _estimate_swing(time_s, specific_force_g, rig, noise_g, "xyz")


def estimate_planar_swing(
    time_s: Array, specific_force_g: Array, *, rig: MountedHousing, noise_g: float | Array | None = None
) -> SwingEstimate:
    """Return the swing in a recording without y, which is zero: in the plane of x and z, or a little beside it."""
    found = _estimate_swing(time_s, specific_force_g, rig, noise_g, "xz")
    if found.coverage95_rad is None or found.phi_max_rad is None or found.u_rad is None or not found.swinging:
        return found
    beside = 1 / float(np.cos(MAX_BESIDE_RAD)) - 1
    low_rad, high_rad = found.coverage95_rad
    return replace(
        found,
        u_rad=float(np.hypot(found.u_rad, beside * found.phi_max_rad)),
        coverage95_rad=(low_rad, min(high_rad * (1 + beside), np.pi)),
        reasons=(NO_Y, *found.reasons),
    )


def _estimate_swing(
    time_s: Array, specific_force_g: Array, rig: MountedHousing, noise_g: float | Array | None, axes: str
) -> SwingEstimate:
    time_s, force_g = validated_samples(time_s, specific_force_g)
    if len(time_s) == 0:
        return SwingEstimate(from_s=0.0, to_s=0.0, swinging=None, reasons=("no samples",))
    from_s, to_s = (float(time_s[end]) - delay_s(rig.bandwidth_hz) for end in (0, -1))
    nominal_period_s = rig.small_swing_period_s
    is_clipped = axially_clipped(force_g)
    time_s, force_g = time_s[~is_clipped], force_g[~is_clipped]
    fault = find_fault(force_g, axes)
    if to_s - from_s < MIN_PERIODS * nominal_period_s or len(time_s) < MIN_SAMPLES:
        fault = "shorter than one swing"
    if fault is not None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(fault,))
    noise = effective_noise_g(force_g, noise_g)
    if "y" not in axes:
        noise[1] = noise[0]
    bin_s = nominal_period_s / BINS_PER_PERIOD
    shared = shared_quantisation(time_s, force_g, noise, SHARED_BINS * bin_s)
    force_g, rig = turn_upright(force_g, rig)
    is_spike = lone_spikes(force_g, noise)
    bins = bin_samples(time_s[~is_spike], force_g[~is_spike], bin_s, rig.bandwidth_hz).with_shared_error(shared)
    estimate = _estimate(bins, noise, rig, from_s, to_s)
    left_out = {"spikes left out": is_spike, "clipped at the upper end of z, and left out": is_clipped}
    reasons = (f"{what}: {count} samples" for what, which in left_out.items() if (count := int(which.sum())))
    return replace(estimate, reasons=(*estimate.reasons, *reasons))


def _estimate(bins: Bins, noise_g: Array, rig: MountedHousing, from_s: float, to_s: float) -> SwingEstimate:
    """Decide between at rest, hardly visible, irregular and swinging."""
    harmonics = find_harmonics(bins, noise_g, rig)
    if harmonics.gain < MIN_GAIN:
        return _faint_estimate(bins, noise_g, rig, at_rest_estimate(bins, noise_g, rig, harmonics, from_s))
    irregular = (
        irregular_motion_estimate(bins, noise_g, rig, from_s) if harmonics.unexplained > MIN_UNEXPLAINED_RATIO else None
    )
    return irregular or _swinging_estimate(bins, noise_g, rig, harmonics, from_s, to_s)


def _faint_estimate(bins: Bins, noise_g: Array, rig: MountedHousing, at_rest: SwingEstimate) -> SwingEstimate:
    """Return the estimate where only the axial force may show a swing: one that may be none, or that of a load at rest."""
    harmonics = find_harmonics(bins, noise_g, rig, axial=True)
    if harmonics.axial_gain < MIN_FIT_GAIN:
        return at_rest
    from_s, to_s = at_rest.from_s, at_rest.to_s
    guesses = initial_motions(harmonics, rig, from_s, to_s + GRID_MARGIN_PERIODS * rig.small_swing_period_s)
    result = fit_robust_from(bins, noise_g, guesses, nominal_prior(rig), FIRST_ITERATIONS)
    if result is None or not result.is_valid or likelihood_gains(result)[2] < MIN_AXIAL_GAIN:
        return at_rest
    return upper_bound_amplitude(make_estimate(result, noise_g, from_s, to_s), at_rest)


def _swinging_estimate(
    bins: Bins, noise_g: Array, rig: MountedHousing, harmonics: Harmonics, from_s: float, to_s: float
) -> SwingEstimate:
    """Return the estimate of a load that moves: a pendulum on the nominal rig, with the relaxed prior, or in segments."""
    guesses = initial_motions(harmonics, rig, from_s, to_s + GRID_MARGIN_PERIODS * rig.small_swing_period_s)
    result = _whole_fit(bins, noise_g, guesses, nominal_prior(rig), from_s, to_s)
    axes = check_axes(bins, noise_g, rig, _length_m(result, harmonics, rig))
    if axes.fault is not None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(axes.fault,))
    result = choose_damping(result, _damped_fit(result, bins, noise_g, damped_prior(rig), from_s, to_s))
    if result is None or not result.is_explained:
        result = choose_prior(result, _whole_fit(bins, noise_g, guesses, relaxed_prior(rig), from_s, to_s))
    if result is not None and result.is_valid and is_below_detection(result):
        return _faint_estimate(bins, noise_g, rig, at_rest_estimate(bins, noise_g, rig, harmonics, from_s))
    if result is not None and result.is_valid and result.uncertainty.misfit < NO_EVENT_MISFIT:
        return make_estimate(inflate_uncertainty(result, axes.angle_u_rel), noise_g, from_s, to_s)
    return _segmented_estimate(result, bins, noise_g, rig, from_s, to_s)


def _whole_fit(
    bins: Bins, noise_g: Array, guesses: list[PendulumMotion], prior: Prior, from_s: float, to_s: float
) -> FitResult | None:
    """Return the fit of the recording from its first periods on, or from guesses for all of it: the most likely of both."""
    result = grow_window(bins, noise_g, prior, from_s, to_s)
    if len(guesses) == 1 and (result is None or not result.is_explained):
        result = choose_fit(result, fit_robust_from(bins, noise_g, guesses, prior, FIRST_ITERATIONS))
    whole = result if _is_whole(result, bins) else None
    several = guesses if len(guesses) > 1 else []
    return choose_mode(whole, several, bins, noise_g, prior, FIRST_ITERATIONS) or result


def _is_whole(result: FitResult | None, bins: Bins) -> TypeGuard[FitResult]:
    """Return whether a fit converged on a recording, and not only on its first periods."""
    return result is not None and result.fit.converged and len(result.fit.bins) > len(bins) / 2


def _damped_fit(
    viscous: FitResult | None, bins: Bins, noise_g: Array, prior: Prior, from_s: float, to_s: float
) -> FitResult | None:
    """Return the fit with quadratic drag and dry friction beside the viscous damping."""
    found: FitResult | None = None
    if _is_whole(viscous, bins):
        start = viscous.fit.motion.with_parameters(prior.n_parameters)
        found = fit_robust(bins, noise_g, start, prior, FIRST_ITERATIONS, viscous.fit.sensor)
    if found is None or not found.is_valid:
        found = choose_fit(found, grow_window(bins, noise_g, prior, from_s, to_s))
    return found


def _length_m(result: FitResult | None, harmonics: Harmonics, rig: MountedHousing) -> float:
    """Return the rope's length by the period of the fit, or where there is none by that of the harmonics."""
    if result is not None and result.is_valid:
        return result.fit.motion.length_m
    return rig.length_of(2 * np.pi * harmonics.frequency_hz)


def _segmented_estimate(
    whole: FitResult | None, bins: Bins, noise_g: Array, rig: MountedHousing, from_s: float, to_s: float
) -> SwingEstimate:
    """Return the estimate from segments that follow a free pendulum each, where that is better than the whole."""
    is_valid = whole is not None and whole.is_valid
    period_s = whole.fit.motion.period_s if whole is not None and is_valid else rig.small_swing_period_s
    segments = Segmenter(bins, noise_g, nominal_prior(rig), period_s, to_s).segments(from_s)
    if segments:
        segments = fit_gaps_with_hoisting(segments, bins, noise_g, nominal_prior(rig), (from_s, to_s))
        estimate = combine_segments(segments, noise_g, from_s, to_s, period_s)
        if estimate.u_rad is not None or not is_valid:
            return estimate
    if whole is None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(NO_MOTION,))
    return make_estimate(whole, noise_g, from_s, to_s)


def grow_window(bins: Bins, noise_g: Array, prior: Prior, from_s: float, to_s: float) -> FitResult | None:
    """Fit the first periods from harmonics, then ever longer windows, each from the motion of the last."""
    rig, first_s = prior.rig, float(bins.time_s[0])  # clipped readings before the first bin may have been left out
    nominal_period_s = rig.small_swing_period_s
    window_s = FIRST_WINDOW_PERIODS * nominal_period_s
    if angle_by_axial_force(bins.select(bins.time_s < first_s + window_s)) > WIDE_RAD:
        window_s = FIRST_WINDOW_OF_WIDE_PERIODS * nominal_period_s
    result: FitResult | None = None
    while True:
        window = bins.select(bins.time_s < first_s + window_s)
        if len(window) < min(MIN_FITTED_BINS, len(bins)):
            window_s *= WINDOW_GROWTH
            continue
        end_s = min(first_s + window_s, to_s) + GRID_MARGIN_PERIODS * nominal_period_s
        if result is None:
            guesses = initial_motions(find_harmonics(window, noise_g, rig), rig, from_s, end_s)
            result = fit_robust_from(window, noise_g, guesses, prior, FIRST_ITERATIONS)
        else:
            start = result.fit.motion.extended(from_s, end_s)
            result = fit_robust(window, noise_g, start, prior, FIRST_ITERATIONS)
        is_abandoned = result is None or result.uncertainty.misfit > ABANDON_MISFIT
        if is_abandoned or len(window) == len(bins):
            return result
        window_s *= WINDOW_GROWTH
