"""The swing of a live stream: the same fit as for a recording, on a moving window, started from the previous result."""

from collections.abc import Callable
from dataclasses import replace

from gateway.numerics.array import Array
from gateway.swing.data.bins import BINS_PER_PERIOD, Bins, merge
from gateway.swing.data.input_checks import find_fault_in_means
from gateway.swing.data.recent_window import RecentWindow
from gateway.swing.detection.dead_axis import DeadAxis, check_axes_in_window
from gateway.swing.detection.rest_detection import (
    FAINTEST_GAIN,
    RESTLESS,
    at_rest_estimate,
    irregular_motion_estimate,
    is_below_detection,
)
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.hoist_tracking import BACK_PERIODS, fit_hoist, spline_step_s
from gateway.swing.estimation.make_estimate import NO_MOTION, hoisting_intervals_s, make_estimate, predict_next_maximum
from gateway.swing.estimation.robust_fit import (
    FitResult,
    choose_prior,
    fit_robust,
    fit_robust_from,
    inflate_uncertainty,
)
from gateway.swing.fit.gauss_newton import SwingFit
from gateway.swing.fit.harmonics import find_harmonics
from gateway.swing.fit.initial_guess import initial_motions
from gateway.swing.fit.multiple_shooting import shift_window
from gateway.swing.fit.priors import nominal_prior, relaxed_prior
from gateway.swing.formulas import LowpassGain, as_published, corrected
from gateway.swing.model.motion import N_BASE_PARAMETERS
from gateway.swing.rig import MountedHousing

WINDOW_PERIODS = 3.0
SHORT_WINDOW_PERIODS = 0.85
LONGEST_WINDOW_S = 45.0
UPDATES_PER_PERIOD = 3
LONGEST_INTERVAL_S = 2.5
UNSETTLED_INTERVAL_S = 1.0
"""While nothing swings, or no pendulum explains what does: news is wanted sooner."""
FIRST_LOOK_PERIODS = 0.9
WARM_ITERATIONS, COLD_ITERATIONS = 4, 6
RETRY_PERIODS = 1 - SHORT_WINDOW_PERIODS
"""Longest pause between tries: the first value after a disturbance comes within one period."""
PATIENCE = 6
"""Failures in a row after which tries become rarer."""
WHOLE_EVERY = 4
"""Of the tries in a row that fail, those that look at more than the last period: what disturbed is still in there."""
FEWEST_BINS = 12
LARGEST_UNEXPLAINED = 0.12
"""By harmonics: a load that is driven is not fitted."""
HOIST_WINDOW_PERIODS = 2.0
LIVE_RASTER_S = 0.5
"""A finer one costs too much every third of a swing."""
CLEARLY = 0.5
"""Of what a plain pendulum leaves unexplained, that a moving rope must leave to be believed."""
DOUBTFUL_MISFIT = 0.0015
"""Unexplained part of the signal up to which live the rig is not doubted."""
LARGEST_RASTER_ERROR = 0.05
"""Of the integration step against the period, before the raster is made anew."""
AHEAD_PERIODS = 0.6
"""How far the grid reaches beyond the newest sample, for the coming maximum."""


class SwingTracker:
    """Estimates the swing from blocks of samples; pure and deterministic: the same blocks give the same estimates."""

    def __init__(
        self,
        rig: MountedHousing,
        *,
        noise_g: float | Array | None = None,
        lowpass_gain: Callable[[float], float] | None = None,
    ) -> None:
        """`noise_g`: stated sensor noise, 1 sigma per sample. `lowpass_gain`: amplitude ratio of the low-pass at a frequency."""
        self._rig, self._prior = rig, nominal_prior(rig)
        self._lowpass_gain = lowpass_gain
        self._nominal_period_s = rig.small_swing_period_s
        longest_s = min(1.3 * (WINDOW_PERIODS + 0.5) * self._nominal_period_s, LONGEST_WINDOW_S)
        bin_s = self._nominal_period_s / (4 * BINS_PER_PERIOD)
        self._window = RecentWindow(longest_s, bin_s, noise_g, rig.bandwidth_hz)
        self._fit: SwingFit | None = None
        self._from_s: float | None = None
        self._due_s: float | None = None
        self._last_explained_s: float | None = None
        self._failures = 0

    def update(
        self,
        time_s: Array,
        specific_force_g: Array,
        lowpassed_g: Array | None = None,
        rig: MountedHousing | None = None,
    ) -> SwingEstimate | None:
        """Take a block; return an estimate when one is due (at least twice a swing, once a second at rest), else None.

        `time_s`, shape (n,), seconds from any fixed origin; `specific_force_g`, shape (n, 3), calibrated and unfiltered in the
        housing frame; `lowpassed_g`, the same behind the low-pass, is what the four formulas are evaluated on. `rig`: the same
        housing with other uncertainties, used from now on (a sensor that warms up is less well known).
        """
        if rig is not None:
            self._rig, self._prior = rig, nominal_prior(rig)
        if len(time_s) == 0:
            return None
        newest_s = self._window.newest_s
        if newest_s is not None and (time_s[0] < newest_s or time_s[0] - newest_s > self._nominal_period_s):
            self.restart()
        self._window.push(time_s, specific_force_g, lowpassed_g)
        if self._from_s is None or self._due_s is None:
            self._from_s = float(time_s[0])
            self._due_s = self._from_s + FIRST_LOOK_PERIODS * self._nominal_period_s
        now_s = float(time_s[-1])
        if now_s < self._due_s:
            return None
        self._window.flush()
        estimate = self._estimate(now_s)
        self._due_s = now_s + self._interval_s(estimate)
        return self._with_formulas(estimate, now_s)

    def restart(self) -> None:
        """Forget the past, as after a gap."""
        self._window.clear()
        self._fit, self._from_s, self._due_s = None, None, None

    def _estimate(self, now_s: float) -> SwingEstimate:
        noise_g, fine = self._window.noise_g, self._window.fine
        if noise_g is None or self._from_s is None:
            return SwingEstimate(from_s=now_s, to_s=now_s, swinging=None, reasons=("no samples",))
        period_s = self._period_s()
        self._from_s = from_s = max(self._from_s, now_s - WINDOW_PERIODS * period_s, float(fine.time_s[0]))
        bins = self._bins(from_s)
        without_swing = self._no_swing_result(bins, noise_g, from_s, now_s)
        if without_swing is not None:
            self._fit = None
            return without_swing
        result = self._best_fit(from_s, now_s, noise_g, period_s)
        axes = DeadAxis() if result is None else self._check_axes(now_s, noise_g, result.fit.motion.length_m)
        if axes.fault is not None:
            self._fit = None
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(axes.fault,))
        self._fit = result.fit if result is not None and result.is_valid else None
        if result is None:
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(NO_MOTION,))
        if result.is_valid and is_below_detection(result):
            self._fit = None
            return at_rest_estimate(bins, noise_g, self._rig, find_harmonics(bins, noise_g, self._rig), from_s)
        result = inflate_uncertainty(result, axes.angle_u_rel)
        estimate = make_estimate(result, noise_g, max(self._from_s, now_s - result.fit.motion.period_s), now_s)
        return replace(estimate, prediction=predict_next_maximum(result, now_s))

    def _check_axes(self, now_s: float, noise_g: Array, length_m: float) -> DeadAxis:
        """Check the axes over the last swings, including those before a change of the motion."""
        recent = self._bins(now_s - WINDOW_PERIODS * self._period_s())
        return check_axes_in_window(recent, noise_g, self._rig, length_m)

    def _no_swing_result(self, bins: Bins, noise_g: Array, from_s: float, now_s: float) -> SwingEstimate | None:
        """Return the estimate for a broken sensor, a load at rest or an irregular motion; None: search for a swing."""
        fault = find_fault_in_means(bins.force_g)
        if fault is not None:
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(fault,))
        if self._fit is not None:
            return None
        harmonics = find_harmonics(bins, noise_g, self._rig)
        if harmonics.gain < FAINTEST_GAIN:
            return at_rest_estimate(bins, noise_g, self._rig, harmonics, from_s)
        return irregular_motion_estimate(bins, noise_g, self._rig, from_s) if harmonics.unexplained > RESTLESS else None

    def _interval_s(self, estimate: SwingEstimate) -> float:
        """Return the time until the next estimate: short after a disturbance, longer where nothing fits for long."""
        is_settled = estimate.swinging and estimate.coverage95_rad is not None
        period_s = estimate.period_s or self._nominal_period_s
        longest_s = LONGEST_INTERVAL_S if is_settled else UNSETTLED_INTERVAL_S
        interval_s = min(period_s / UPDATES_PER_PERIOD, longest_s)
        self._failures = self._failures + 1 if estimate.swinging is None else 0
        if self._failures == 0:
            return interval_s
        retry_s = min(RETRY_PERIODS * period_s, UNSETTLED_INTERVAL_S)
        was_fitted = estimate.reduced_chi_square is not None  # a fit in vain costs the most
        return retry_s if was_fitted else min(interval_s / 2 * max(self._failures / PATIENCE, 1.0), retry_s)

    def _best_fit(self, from_s: float, now_s: float, noise_g: Array, period_s: float) -> FitResult | None:
        """Return the fit of the whole window, or of its last period where the motion has changed since."""
        short_s = now_s - SHORT_WINDOW_PERIODS * period_s
        is_short = from_s > short_s - 0.1 * period_s
        if self._fit is None and not is_short and self._failures % WHOLE_EVERY:
            return self._fit_last_period(short_s, now_s, noise_g, period_s, None)
        was_hoisting = self._fit is not None and self._fit.motion.splines is not None
        hoist = self._fit_hoisting(from_s, now_s, noise_g, period_s) if was_hoisting else None
        if hoist is not None and hoist.is_explained:
            return hoist
        whole = self._fit_window(from_s, now_s, noise_g, period_s)
        if whole is not None and whole.is_explained:
            self._last_explained_s = now_s
            doubtful = whole.uncertainty.misfit > DOUBTFUL_MISFIT
            return (self._fit_with_relaxed_prior(whole, noise_g) if doubtful else None) or whole
        if not was_hoisting:
            hoist = self._fit_hoisting(from_s, now_s, noise_g, period_s)
        if hoist is not None and (whole is None or hoist.uncertainty.misfit < CLEARLY * whole.uncertainty.misfit):
            return hoist
        relaxed = self._fit_with_relaxed_prior(whole, noise_g)
        if relaxed is not None or is_short:
            return relaxed or whole
        return self._fit_last_period(short_s, now_s, noise_g, period_s, whole)

    def _fit_last_period(
        self, short_s: float, now_s: float, noise_g: Array, period_s: float, whole: FitResult | None
    ) -> FitResult | None:
        """Return the fit of the last period by itself where it leaves clearly less unexplained than the whole window."""
        short = self._fit_from_harmonics(short_s, now_s, noise_g, period_s)
        if short is None or (whole is not None and short.uncertainty.misfit > 0.7 * whole.uncertainty.misfit):
            return whole
        self._from_s = short_s
        return short

    def _fit_with_relaxed_prior(self, whole: FitResult | None, noise_g: Array) -> FitResult | None:
        """Return the fit with the relaxed prior where it explains the window and the rig as stated does not; else None."""
        if whole is None or not whole.is_valid:
            return None
        prior = relaxed_prior(self._rig)
        start = whole.fit.motion.with_parameters(prior.n_parameters)
        result = fit_robust(whole.fit.bins, noise_g, start, prior, COLD_ITERATIONS, whole.fit.sensor)
        return choose_prior(whole, result) if result is not None and result.is_explained else None

    def _fit_hoisting(self, from_s: float, now_s: float, noise_g: Array, period_s: float) -> FitResult | None:
        """Return the previous motion continued on a rope that moves since a pendulum last explained the data; else None."""
        if self._fit is None or self._last_explained_s is None:
            return None
        motion = self._fit.motion
        if motion.splines is None:
            motion = motion.with_parameters(N_BASE_PARAMETERS)
        from_s = max(from_s, motion.grid.start_s, now_s - HOIST_WINDOW_PERIODS * period_s)
        end_s = now_s + AHEAD_PERIODS * period_s
        moving_s = max(from_s, self._last_explained_s - BACK_PERIODS * period_s), end_s
        start, step_s = motion.extended(from_s, end_s), max(spline_step_s(self._rig), LIVE_RASTER_S)
        result = fit_hoist(self._bins(from_s), noise_g, self._rig, start, moving_s, WARM_ITERATIONS, step_s)
        is_significant = result is not None and result.is_valid and bool(hoisting_intervals_s(result, from_s, now_s))
        return result if is_significant else None

    def _fit_window(self, from_s: float, now_s: float, noise_g: Array, period_s: float) -> FitResult | None:
        """Return the fit of the window from the previous result, or from harmonics where there is none."""
        if self._fit is None:
            return self._fit_from_harmonics(from_s, now_s, noise_g, period_s)
        end_s = now_s + AHEAD_PERIODS * period_s
        motion = self._fit.motion.with_constant_length().with_parameters(N_BASE_PARAMETERS)
        grid_error = abs(motion.grid.period_s / period_s - 1)
        if grid_error > LARGEST_RASTER_ERROR or len(self._fit.motion.parameters) != N_BASE_PARAMETERS:
            start = motion.extended(max(from_s, motion.grid.start_s), end_s)
        else:
            start = shift_window(self._fit.linearised, from_s, end_s)
        sensor = self._fit.sensor if self._fit.prior is self._prior else None
        return fit_robust(self._bins(from_s), noise_g, start, self._prior, WARM_ITERATIONS, sensor)

    def _fit_from_harmonics(self, from_s: float, now_s: float, noise_g: Array, period_s: float) -> FitResult | None:
        bins = self._bins(from_s)
        if len(bins) < FEWEST_BINS:
            return None
        harmonics = find_harmonics(bins, noise_g, self._rig)
        if harmonics.unexplained > LARGEST_UNEXPLAINED:
            return None
        guesses = initial_motions(harmonics, self._rig, from_s, now_s + AHEAD_PERIODS * period_s)
        return fit_robust_from(bins, noise_g, guesses, self._prior, COLD_ITERATIONS)

    def _period_s(self) -> float:
        return self._nominal_period_s if self._fit is None else self._fit.motion.period_s

    def _bins(self, from_s: float) -> Bins:
        fine = self._window.fine
        return merge(fine.select(fine.time_s >= from_s), self._period_s() / BINS_PER_PERIOD)

    def _with_formulas(self, estimate: SwingEstimate, now_s: float) -> SwingEstimate:
        """Return the estimate with the four formulas over the last full swing."""
        if estimate.period_s is None or estimate.length_m is None:
            return estimate
        found = self._window.extremes_since(now_s - estimate.period_s)
        if found is None:
            return estimate
        gain = self._lowpass_gain or (lambda _frequency_hz: 1.0)
        lowpass = LowpassGain(gain_f0=gain(1 / estimate.period_s), gain_2f0=gain(2 / estimate.period_s))
        rho = self._rig.rho_at(estimate.length_m)
        return replace(estimate, formulas=as_published(found), corrected_formulas=corrected(found, rho, lowpass))
