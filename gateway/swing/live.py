"""The swing of a live stream: the same fit as for a recording, on a window that moves, started from the last answer."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gateway.swing.data.bins import BINS_PER_PERIOD, Bins, merge
from gateway.swing.data.input_checks import fault_of_means
from gateway.swing.data.recent_window import RecentWindow
from gateway.swing.detection.dead_axis import DeadAxis, silence_in
from gateway.swing.detection.rest_detection import (
    FAINTEST_GAIN,
    RESTLESS,
    at_rest_estimate,
    irregular_motion_estimate,
    is_below_detection,
)
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.hoist_tracking import BACK_PERIODS, hoist_find, raster_step_s
from gateway.swing.estimation.make_estimate import NO_MOTION, assess, hoisting_duration_s, predict
from gateway.swing.estimation.robust_fit import (
    FitResult,
    choose_prior,
    fit_robust,
    fit_robust_from,
    inflate_uncertainty,
)
from gateway.swing.fit.initial_guess import find_harmonics, start_motions
from gateway.swing.fit.likelihood import Fit
from gateway.swing.fit.multiple_shooting import advanced
from gateway.swing.fit.priors import nominal_prior, relaxed_prior
from gateway.swing.formulas import LowpassGain, as_published, corrected
from gateway.swing.model.motion import PLAIN
from gateway.swing.model.spherical_pendulum import Real
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
    """Pure and deterministic: fed with blocks, the same blocks give the same estimates."""

    def __init__(
        self,
        rig: MountedHousing,
        *,
        noise_g: float | Real | None = None,
        lowpass_gain: Callable[[float], float] | None = None,
    ) -> None:
        """`noise_g`: stated sensor noise, 1 sigma per sample. `lowpass_gain`: amplitude ratio of the low-pass at a frequency."""
        self._rig, self._beliefs = rig, nominal_prior(rig)
        self._lowpass_gain = lowpass_gain
        self._belief_s = rig.small_swing_period_s
        longest_s = min(1.3 * (WINDOW_PERIODS + 0.5) * self._belief_s, LONGEST_WINDOW_S)
        self._window = RecentWindow(longest_s, self._belief_s / (4 * BINS_PER_PERIOD), noise_g, rig.bandwidth_hz)
        self._fit: Fit | None = None
        self._from_s: float | None = None
        self._due_s: float | None = None
        self._plain_s: float | None = None
        self._failures = 0

    def update(
        self,
        time_s: Real,
        specific_force_g: Real,
        lowpassed_g: Real | None = None,
        rig: MountedHousing | None = None,
    ) -> SwingEstimate | None:
        """Take a block; a new estimate when one is due (at least twice a swing, once a second when still), else None.

        `time_s`, shape (n,), seconds from any fixed origin; `specific_force_g`, shape (n, 3), calibrated and unfiltered in the
        housing frame; `lowpassed_g`, the same behind the low-pass, is what the four formulas are evaluated on. `rig`: the
        same housing with other uncertainties, believed from now on (a sensor that warms up is less well known).
        """
        if rig is not None:
            self._rig, self._beliefs = rig, nominal_prior(rig)
        if len(time_s) == 0:
            return None
        newest_s = self._window.newest_s
        if newest_s is not None and (time_s[0] < newest_s or time_s[0] - newest_s > self._belief_s):
            self.restart()
        self._window.push(time_s, specific_force_g, lowpassed_g)
        if self._from_s is None or self._due_s is None:
            self._from_s, self._due_s = float(time_s[0]), float(time_s[0]) + FIRST_LOOK_PERIODS * self._belief_s
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
        other = self._no_swing_result(bins, noise_g, from_s, now_s)
        if other is not None:
            self._fit = None
            return other
        finding = self._best(from_s, now_s, noise_g, period_s)
        silence = DeadAxis() if finding is None else self._silence(now_s, noise_g, finding.fit.motion.length_m)
        if silence.fault is not None:
            self._fit = None
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(silence.fault,))
        self._fit = finding.fit if finding is not None and finding.sound else None
        if finding is None:
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(NO_MOTION,))
        if finding.sound and is_below_detection(finding):
            self._fit = None
            return at_rest_estimate(bins, noise_g, self._rig, find_harmonics(bins, noise_g, self._rig), from_s)
        finding = inflate_uncertainty(finding, silence.angle_u_rel)
        estimate = assess(finding, noise_g, max(self._from_s, now_s - finding.fit.motion.period_s), now_s)
        return replace(estimate, prediction=predict(finding, now_s))

    def _silence(self, now_s: float, noise_g: Real, length_m: float) -> DeadAxis:
        """Of the last swings, those before a change too: they tell of the sensor."""
        recent = self._bins(now_s - WINDOW_PERIODS * self._period_s())
        return silence_in(recent, noise_g, self._rig, length_m)

    def _no_swing_result(self, bins: Bins, noise_g: Real, from_s: float, now_s: float) -> SwingEstimate | None:
        """A broken sensor, a still load, a restless rope; None: a swing is to be looked for, or is being followed."""
        fault = fault_of_means(bins.force_g)
        if fault is not None:
            return SwingEstimate(from_s=from_s, to_s=now_s, swinging=None, reasons=(fault,))
        if self._fit is not None:
            return None
        harmonics = find_harmonics(bins, noise_g, self._rig)
        if harmonics.gain < FAINTEST_GAIN:
            return at_rest_estimate(bins, noise_g, self._rig, harmonics, from_s)
        return irregular_motion_estimate(bins, noise_g, self._rig, from_s) if harmonics.unexplained > RESTLESS else None

    def _interval_s(self, estimate: SwingEstimate) -> float:
        """Until the next estimate: sooner after a disturbance, later where nothing fits for long or a fit was tried in vain."""
        settled = estimate.swinging and estimate.coverage95_rad is not None
        period_s = estimate.period_s or self._belief_s
        longest_s = LONGEST_INTERVAL_S if settled else UNSETTLED_INTERVAL_S
        interval_s = min(period_s / UPDATES_PER_PERIOD, longest_s)
        self._failures = self._failures + 1 if estimate.swinging is None else 0
        if self._failures == 0:
            return interval_s
        again_s = min(RETRY_PERIODS * period_s, UNSETTLED_INTERVAL_S)
        costly = estimate.reduced_chi_square is not None
        return again_s if costly else min(interval_s / 2 * max(self._failures / PATIENCE, 1.0), again_s)

    def _best(self, from_s: float, now_s: float, noise_g: Real, period_s: float) -> FitResult | None:
        """The fit of the whole window, or of its last period where the motion has changed since."""
        short_s = now_s - SHORT_WINDOW_PERIODS * period_s
        lately = from_s > short_s - 0.1 * period_s
        if self._fit is None and not lately and self._failures % WHOLE_EVERY:
            return self._short(short_s, now_s, noise_g, period_s, None)
        hoisted = self._fit is not None and self._fit.motion.raster is not None
        hoist = self._hoisting(from_s, now_s, noise_g, period_s) if hoisted else None
        if hoist is not None and hoist.plain:
            return hoist
        whole = self._find(from_s, now_s, noise_g, period_s)
        if whole is not None and whole.plain:
            self._plain_s = now_s
            return (
                self._fit_with_relaxed_prior(whole, noise_g) if whole.claim.misfit > DOUBTFUL_MISFIT else None
            ) or whole
        if not hoisted:
            hoist = self._hoisting(from_s, now_s, noise_g, period_s)
        if hoist is not None and (whole is None or hoist.claim.misfit < CLEARLY * whole.claim.misfit):
            return hoist
        doubting = self._fit_with_relaxed_prior(whole, noise_g)
        if doubting is not None or lately:
            return doubting or whole
        return self._short(short_s, now_s, noise_g, period_s, whole)

    def _short(
        self, short_s: float, now_s: float, noise_g: Real, period_s: float, whole: FitResult | None
    ) -> FitResult | None:
        """The last period by itself, where that leaves clearly less than the whole window."""
        short = self._cold(short_s, now_s, noise_g, period_s)
        if short is None or (whole is not None and short.claim.misfit > 0.7 * whole.claim.misfit):
            return whole
        self._from_s = short_s
        return short

    def _fit_with_relaxed_prior(self, whole: FitResult | None, noise_g: Real) -> FitResult | None:
        """What explains the window when the rig as stated does not: a wrong position, offset, scale; None where nothing does."""
        if whole is None or not whole.sound:
            return None
        beliefs = relaxed_prior(self._rig)
        start = whole.fit.motion.with_parameters(beliefs.parameters)
        finding = fit_robust(whole.fit.bins, noise_g, start, beliefs, COLD_ITERATIONS, whole.fit.instrument)
        return choose_prior(whole, finding) if finding is not None and finding.plain else None

    def _hoisting(self, from_s: float, now_s: float, noise_g: Real, period_s: float) -> FitResult | None:
        """The last answer carried on, on a rope that moves since a plain pendulum last explained the motion."""
        if self._fit is None or self._plain_s is None:
            return None
        motion = self._fit.motion
        if motion.raster is None:
            motion = motion.with_parameters(PLAIN)
        from_s = max(from_s, motion.grid.start_s, now_s - HOIST_WINDOW_PERIODS * period_s)
        end_s = now_s + AHEAD_PERIODS * period_s
        moves_s = max(from_s, self._plain_s - BACK_PERIODS * period_s), end_s
        start, step_s = motion.extended(from_s, end_s), max(raster_step_s(self._rig), LIVE_RASTER_S)
        finding = hoist_find(self._bins(from_s), noise_g, self._rig, start, moves_s, WARM_ITERATIONS, step_s)
        sure = finding is not None and finding.sound and bool(hoisting_duration_s(finding, from_s, now_s))
        return finding if sure else None

    def _find(self, from_s: float, now_s: float, noise_g: Real, period_s: float) -> FitResult | None:
        """From the last answer; cold where there is none."""
        if self._fit is None:
            return self._cold(from_s, now_s, noise_g, period_s)
        end_s = now_s + AHEAD_PERIODS * period_s
        motion = self._fit.motion.with_constant_length().with_parameters(PLAIN)
        raster_s = 2 * np.pi / motion.grid.rate_1_s
        if abs(raster_s / period_s - 1) > LARGEST_RASTER_ERROR or len(self._fit.motion.parameters) != PLAIN:
            start = motion.extended(max(from_s, motion.grid.start_s), end_s)
        else:
            start = advanced(self._fit.response, from_s, end_s)
        instrument = self._fit.instrument if self._fit.beliefs is self._beliefs else None
        return fit_robust(self._bins(from_s), noise_g, start, self._beliefs, WARM_ITERATIONS, instrument)

    def _cold(self, from_s: float, now_s: float, noise_g: Real, period_s: float) -> FitResult | None:
        bins = self._bins(from_s)
        if len(bins) < FEWEST_BINS:
            return None
        harmonics = find_harmonics(bins, noise_g, self._rig)
        if harmonics.unexplained > LARGEST_UNEXPLAINED:
            return None
        starts = start_motions(harmonics, self._rig, from_s, now_s + AHEAD_PERIODS * period_s)
        return fit_robust_from(bins, noise_g, starts, self._beliefs, COLD_ITERATIONS)

    def _period_s(self) -> float:
        return self._belief_s if self._fit is None else self._fit.motion.period_s

    def _bins(self, from_s: float) -> Bins:
        fine = self._window.fine
        return merge(fine.select(fine.time_s >= from_s), self._period_s() / BINS_PER_PERIOD)

    def _with_formulas(self, estimate: SwingEstimate, now_s: float) -> SwingEstimate:
        """The four formulas over the last full swing."""
        if estimate.period_s is None or estimate.length_m is None:
            return estimate
        found = self._window.extremes_since(now_s - estimate.period_s)
        if found is None:
            return estimate
        gain = self._lowpass_gain or (lambda _frequency_hz: 1.0)
        passage = LowpassGain(gain_f0=gain(1 / estimate.period_s), gain_2f0=gain(2 / estimate.period_s))
        rho = self._rig.rho_at(estimate.length_m)
        return replace(estimate, formulas=as_published(found), corrected_formulas=corrected(found, rho, passage))
