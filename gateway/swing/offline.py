"""The swing in a whole recording."""

from dataclasses import replace

import numpy as np

from gateway.numerics.spikes import lone_spikes
from gateway.swing.data.bins import BINS_PER_PERIOD, Bins, bin_samples, checked
from gateway.swing.data.input_checks import fault_of
from gateway.swing.data.noise import believed_noise_g
from gateway.swing.detection.dead_axis import silence_of
from gateway.swing.detection.rest_detection import (
    FAINTEST_AXIAL_GAIN,
    FAINTEST_GAIN,
    RESTLESS,
    WORTH_A_FIT,
    at_rest_estimate,
    gains,
    irregular_motion_estimate,
    is_below_detection,
    upper_bound_amplitude,
)
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.make_estimate import NO_MOTION, assess
from gateway.swing.estimation.robust_fit import (
    FitResult,
    choose_fit,
    choose_prior,
    fit_robust,
    fit_robust_from,
    inflate_uncertainty,
)
from gateway.swing.estimation.segmentation import Segmenter, assess_pieces, fit_gaps_with_hoisting
from gateway.swing.fit.initial_guess import Harmonics, find_harmonics, start_motions
from gateway.swing.fit.priors import Prior, nominal_prior, relaxed_prior
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing

FIRST_WINDOW_PERIODS = 3.0
GROWTH = 2.2
FEWEST_PERIODS = 0.8
FEWEST_SAMPLES = 8
FIRST_ITERATIONS = 25
NO_EVENT_MISFIT = 0.01
"""Unexplained part of the signal above which the recording is looked through for an event."""
HOPELESS_MISFIT = 0.3
"""Unexplained part of the signal at which longer windows are not tried."""
MARGIN = 0.05
"""Of a period, that a grid reaches beyond the last sample."""


def estimate_swing(
    time_s: Real, specific_force_g: Real, *, rig: MountedHousing, noise_g: float | Real | None = None
) -> SwingEstimate:
    """The swing in a recording.

    `time_s`, shape (n,), never falling; `specific_force_g`, shape (n, 3), calibrated and unfiltered, housing frame, in units
    of the site's gravity (hanging at rest: 0, 0, 1). Rows with NaN are left out. `noise_g`: 1 sigma per sample, scalar or
    per axis. Raises ValueError for arrays of wrong shape or times that fall.
    """
    time_s, force_g = checked(time_s, specific_force_g)
    if len(time_s) == 0:
        return SwingEstimate(from_s=0.0, to_s=0.0, swinging=None, reasons=("no samples",))
    from_s, to_s = (float(time_s[end]) - delay_s(rig.bandwidth_hz) for end in (0, -1))
    belief_s = rig.small_swing_period_s
    fault = fault_of(force_g)
    if to_s - from_s < FEWEST_PERIODS * belief_s or len(time_s) < FEWEST_SAMPLES:
        fault = "shorter than one swing"
    if fault is not None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(fault,))
    noise = believed_noise_g(force_g, noise_g)
    spiky = lone_spikes(force_g, noise)
    bins = bin_samples(time_s[~spiky], force_g[~spiky], belief_s / BINS_PER_PERIOD, rig.bandwidth_hz)
    estimate = _of_bins(bins, noise, rig, from_s, to_s)
    said = (f"spikes left out: {count} samples",) if (count := int(spiky.sum())) else ()
    return replace(estimate, reasons=(*estimate.reasons, *said))


def _of_bins(bins: Bins, noise: Real, rig: MountedHousing, from_s: float, to_s: float) -> SwingEstimate:
    """Still, faint, restless or swinging."""
    harmonics = find_harmonics(bins, noise, rig)
    if harmonics.gain < FAINTEST_GAIN:
        return _faint_estimate(bins, noise, rig, at_rest_estimate(bins, noise, rig, harmonics, from_s))
    restless = irregular_motion_estimate(bins, noise, rig, from_s) if harmonics.unexplained > RESTLESS else None
    return restless or _swinging_estimate(bins, noise, rig, harmonics, from_s, to_s)


def _faint_estimate(bins: Bins, noise_g: Real, rig: MountedHousing, still: SwingEstimate) -> SwingEstimate:
    """Nothing that noise could not make, but for what the axial force may show: then a swing that may as well be none."""
    harmonics = find_harmonics(bins, noise_g, rig, axial=True)
    if harmonics.axial_gain < WORTH_A_FIT:
        return still
    from_s, to_s = still.from_s, still.to_s
    starts = start_motions(harmonics, rig, from_s, to_s + MARGIN * rig.small_swing_period_s)
    finding = fit_robust_from(bins, noise_g, starts, nominal_prior(rig), FIRST_ITERATIONS)
    if finding is None or not finding.sound or gains(finding)[2] < FAINTEST_AXIAL_GAIN:
        return still
    return upper_bound_amplitude(assess(finding, noise_g, from_s, to_s), still)


def _swinging_estimate(
    bins: Bins, noise_g: Real, rig: MountedHousing, harmonics: Harmonics, from_s: float, to_s: float
) -> SwingEstimate:
    """Something moves: a pendulum with the rig as stated, else one with the rig doubted, else free stretches of one."""
    finding = grow(bins, noise_g, nominal_prior(rig), from_s, to_s)
    if finding is None or not finding.plain:  # the first periods may have been taken for a swing the other way round
        starts = start_motions(harmonics, rig, from_s, to_s + MARGIN * rig.small_swing_period_s)
        finding = choose_fit(finding, fit_robust_from(bins, noise_g, starts, nominal_prior(rig), FIRST_ITERATIONS))
    silence = silence_of(bins, noise_g, rig, _length_m(finding, harmonics, rig))
    if silence.fault is not None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(silence.fault,))
    if finding is None or not finding.plain:
        finding = choose_prior(finding, grow(bins, noise_g, relaxed_prior(rig), from_s, to_s))
    if finding is not None and finding.sound and is_below_detection(finding):
        return _faint_estimate(bins, noise_g, rig, at_rest_estimate(bins, noise_g, rig, harmonics, from_s))
    if finding is not None and finding.sound and finding.claim.misfit < NO_EVENT_MISFIT:
        return assess(inflate_uncertainty(finding, silence.angle_u_rel), noise_g, from_s, to_s)
    return _piecewise(finding, bins, noise_g, rig, from_s, to_s)


def _length_m(finding: FitResult | None, harmonics: Harmonics, rig: MountedHousing) -> float:
    """By the period: of the fit, or where there is none of the harmonics."""
    if finding is not None and finding.sound:
        return finding.fit.motion.length_m
    return rig.length_of(2 * np.pi * harmonics.frequency_hz)


def _piecewise(
    whole: FitResult | None, bins: Bins, noise_g: Real, rig: MountedHousing, from_s: float, to_s: float
) -> SwingEstimate:
    """Something happened, or the pendulum is a poor model: free stretches by themselves, where that is better."""
    sound = whole is not None and whole.sound
    period_s = whole.fit.motion.period_s if whole is not None and sound else rig.small_swing_period_s
    pieces = Segmenter(bins, noise_g, nominal_prior(rig), period_s, to_s).cut(from_s)
    if pieces:
        pieces = fit_gaps_with_hoisting(pieces, bins, noise_g, nominal_prior(rig), (from_s, to_s))
        estimate = assess_pieces(pieces, noise_g, from_s, to_s, period_s)
        if estimate.u_rad is not None or not sound:
            return estimate
    if whole is None:
        return SwingEstimate(from_s=from_s, to_s=to_s, swinging=None, reasons=(NO_MOTION,))
    return assess(whole, noise_g, from_s, to_s)


def grow(bins: Bins, noise_g: Real, beliefs: Prior, from_s: float, to_s: float) -> FitResult | None:
    """Fit the first periods from harmonics, then ever longer windows, each from the last."""
    rig = beliefs.rig
    belief_s = rig.small_swing_period_s
    span_s = FIRST_WINDOW_PERIODS * belief_s
    finding: FitResult | None = None
    while True:
        window = bins.select(bins.time_s < from_s + span_s)
        end_s = min(from_s + span_s, to_s) + MARGIN * belief_s
        if finding is None:
            starts = start_motions(find_harmonics(window, noise_g, rig), rig, from_s, end_s)
            finding = fit_robust_from(window, noise_g, starts, beliefs, FIRST_ITERATIONS)
        else:
            start = finding.fit.motion.extended(from_s, end_s)
            finding = fit_robust(window, noise_g, start, beliefs, FIRST_ITERATIONS)
        hopeless = finding is None or finding.claim.misfit > HOPELESS_MISFIT
        if hopeless or len(window) == len(bins):
            return finding
        span_s *= GROWTH
