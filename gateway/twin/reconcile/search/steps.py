"""Steps of the search: what is found before it, what a score test ranks highest, and events.

Changepoints and a scan say when something may have happened, fits say what.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.swing.detection.rope_length import rope_length_by_period
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import ParameterKind, Values
from gateway.twin.effects.rope import DoublePendulum, RopeLength
from gateway.twin.effects.sensor import Clipping, ClockDrift, Quantization, SampleHold, Vibration
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Recordings
from gateway.twin.reconcile.data.sensor import (
    MIN_NAMED_STEP_SIGMA,
    detect_quantisation_step,
    detect_saturation,
    noise_with_quantisation_g,
)
from gateway.twin.reconcile.fit.fit_context import FitContext, sensitivities_sigma
from gateway.twin.reconcile.fit.multiple_shooting import REFINE_ITERATIONS
from gateway.twin.reconcile.residual import EXCESS_SIGNIFICANT, warrants_another_effect
from gateway.twin.reconcile.search.candidates import (
    LITTLE_OF_GAP,
    MIN_VARIANCE_SHARE,
    MOST_OF_GAP,
    CandidateFit,
    CandidateTable,
)
from gateway.twin.reconcile.search.changepoints import exclude_unmodelled_profiles, scan_for_changepoints
from gateway.twin.reconcile.search.context import FitRequest, SearchContext
from gateway.twin.reconcile.search.validation import Validator
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
MAX_SCORED = 4
"""Effects that are fitted beside a parent, by their score, as long as none explains the log."""
FITTED_FIRST = 2
"""Of these, those that are fitted before the best of them limits the rest."""
MIN_SHARE_OF_BEST_SCORE = 0.5
"""Predicted gain over that of the best effect: one that reaches less is no rival to an effect that explains the log."""
MAX_PARENTS = 2
"""Best fits of a size that are worked on: beside which a further effect is searched for, or that are refined."""
MAX_PARENT_CHI2_RATIO = 100.0
"""Chi-square over that of the best of the same size: a parent with more lacks what the best one has."""


def detect_in_samples(
    recordings: Recordings, rows_per_reading: float, model: EffectValues
) -> tuple[Recordings, EffectValues]:
    """Detect steps, limits and repeats of the samples, which need no model; steps add their variance to the noise.

    `model` are the effects that are known already.
    """
    recordings, detected = _detect_steps_or_limits(recordings)
    if rows_per_reading > 1 and SampleHold.name not in model:
        detected = {**detected, SampleHold.name: {"rows": rows_per_reading}}
    return recordings, detected


def _detect_steps_or_limits(recordings: Recordings) -> tuple[Recordings, EffectValues]:
    log, held_out = recordings.log, recordings.held_out
    step_g = detect_quantisation_step(log.force_g, log.noise_g)
    if step_g is not None:
        noise_g = noise_with_quantisation_g(log, step_g)
        log, held_out = replace(log, noise_g=noise_g), replace(held_out, noise_g=noise_g)
        is_named = step_g > MIN_NAMED_STEP_SIGMA * float(np.min(recordings.log.noise_g))
        coarse = replace(recordings, log=log, held_out=held_out, held_out_as_stamped=held_out)
        return coarse, {Quantization.name: {"lsb_g": step_g}} if is_named else {}
    limit_g = detect_saturation(log.force_g)
    return recordings, {} if limit_g is None else {Clipping.name: {"full_scale_g": limit_g}}


def fit_baseline(
    table: CandidateTable, context: SearchContext, detected: EffectValues, validator: Validator
) -> tuple[CandidateTable, SearchContext]:
    """Fit the effects that were detected, a wrong length and a machine's line; the search starts from these."""
    if table.get(detected) is None:
        table = context.fit(table, detected)
    base = table.get(detected) or table.fits[frozenset()]
    table, base = _add_rope_length(table, context, base)
    context = replace(context, baseline_effects={name: base.values[name] for name in base.values})
    return _add_machine_line(table, context, base, validator)


def _add_rope_length(
    table: CandidateTable, context: SearchContext, base: CandidateFit
) -> tuple[CandidateTable, CandidateFit]:
    """Add an error of the rope's length where the period of a large swing, at its amplitude, contradicts the rig.

    Beside a model that is soon out of phase no effect shows as what it is. Backward elimination removes an error that a model
    with losses does not need; the model without them does not tell.
    """
    error = length_error_by_period(context.setting) if context.setting.log.has_large_amplitude else None
    if error is None:
        return table, base
    values = {**base.values, RopeLength.name: {"relative_error": error}}
    table = context.fit(table, values)
    return table, table.get(values) or base


def _add_machine_line(
    table: CandidateTable, context: SearchContext, base: CandidateFit, validator: Validator
) -> tuple[CandidateTable, SearchContext]:
    """Add a machine's line, which is far above the swing's frequencies and hides nothing.

    Only a line that is in the held-out recording, too: steps of the samples and the swing make lines of their own.
    """
    log, setting = context.setting.log, context.setting
    if Vibration.name in setting.model_effects:
        return table, context
    guesses = context.guesses(Vibration.name, base)
    if not guesses:
        return table, context
    table = context.fit(table, {**base.values, Vibration.name: guesses[0]})
    found = table.get({*base.values, Vibration.name})
    if found is None or base.fit.chi2 - found.fit.chi2 < MIN_VARIANCE_SHARE * log.n_values:
        return table, context
    without, with_line = (validator.evaluate(each).reduced_chi2 for each in (base, found))
    is_repeated = without - with_line > MOST_OF_GAP * (base.reduced_chi2 - found.reduced_chi2)
    return table, replace(context, baseline_effects=found.values) if is_repeated else context


def length_error_by_period(setting: FitContext) -> float | None:
    """Return the relative error of the rope's length where the period, at its amplitude, contradicts the rig; else None."""
    rig, log = setting.rig, setting.log
    by_period = rope_length_by_period(log.time_s, log.force_g, rig.gravity_m_s2)
    if by_period is None:
        return None
    error = by_period.length_m / rig.length_m - 1
    stated = float(np.asarray(setting.model_effects.get(RopeLength.name, {}).get("relative_error", 0.0)))
    return error if abs(error - stated) >= by_period.u_rel else None


def fit_persistent_effects(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit persistent effects beside the baseline, in the order of their score, until the rest are no rivals.

    A large swing is tried with each loss first: beside a nominal swing that does not decay, scores of all effects mean little.
    Where a loss closes most of the gap, further effects are tried beside it alone.
    """
    base = baseline_of(table, context)
    if context.setting.log.has_large_amplitude:
        losses = EFFECTS.choose(dissipative=True, is_scored=True)
        table = context.fit_in_turn(table, requests_beside(table, context, base, losses)).start_round()
        if table.closest.reduced_chi2 - 1 < LITTLE_OF_GAP * (base.reduced_chi2 - 1):
            return table
    else:
        table = _fit_length_by_period(table, context, base)
    return fit_by_score(table, context, base, at_most=None)


def _fit_length_by_period(table: CandidateTable, context: SearchContext, base: CandidateFit) -> CandidateTable:
    """Fit the length from that of the period; a hoist changes the period as well, and then no length closes most of the gap.

    From the stated length a fit of one that is wrong by a tenth loses the phase, and what bends the rope is named for it.
    """
    error = length_error_by_period(context.setting)
    if error is None:
        return table
    values = {**base.values, RopeLength.name: {"relative_error": error}}
    found = context.fit_apart(values)
    closes_most = found is not None and found.reduced_chi2 - 1 < MOST_OF_GAP * (base.reduced_chi2 - 1)
    return table.with_fit(found).start_round() if found is not None and closes_most else table


def fit_clock_hypotheses(table: CandidateTable, context: SearchContext) -> Iterator[list[CandidateFit]]:
    """Yield fits with a clock error, which may stand for lost samples: beside the baseline, then with what that leaves.

    Where it is not fitted beside the baseline, beside the best persistent effect; of a large swing only where it shows there:
    such a swing leaves a residual for many reasons.
    """
    alone = table.get({*context.baseline_effects, ClockDrift.name})
    if alone is not None:
        yield [alone]
        fits = fit_by_score(table, context, alone, at_most=MAX_SCORED).ranked(len(alone.values) + 1)
        yield [fit for fit in fits if alone.names < fit.names]
        return
    best, values = table.best, {**table.best.values, ClockDrift.name: {}}
    found = context.fit(table, values).get(values)
    if found is not None and (not context.setting.log.has_large_amplitude or table.is_significant(best, found)):
        yield [found]


def fit_persistent_pairs(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit pairs of persistent effects where the best one closes most of the gap: quicker than searching for events."""
    base, best = baseline_of(table, context), table.best
    if table.is_explained or context.setting.log.has_large_amplitude:
        return table
    if best.reduced_chi2 - 1 > MOST_OF_GAP * (base.reduced_chi2 - 1):
        return table
    for parent in parents(table, context, len(base.values) + 1):
        table = fit_by_score(table, context, parent, at_most=MAX_SCORED)
    return table


def fit_by_score(
    table: CandidateTable, context: SearchContext, parent: CandidateFit, at_most: int | None
) -> CandidateTable:
    """Fit the effects beside a parent that a score test ranks highest."""
    signatures = context.signatures(parent)
    gains = {name: signatures.predicted_chi2_drop(name) for name in signatures.of}
    ranked = sorted(gains, key=lambda name: -gains[name])
    is_rival = {name: gains[name] >= MIN_SHARE_OF_BEST_SCORE * gains[ranked[0]] for name in ranked}
    likely = [name for rank, name in enumerate(ranked[:at_most]) if is_rival[name] or rank < MAX_SCORED]

    def is_needed(now: CandidateTable, request: FitRequest) -> bool:
        (name,) = request.values.keys() - parent.names
        return not context.budget.is_exhausted and (is_rival[name] or not now.is_explained)

    table = context.fit_in_turn(table, requests_beside(table, context, parent, likely[:FITTED_FIRST]), is_needed)
    table = table.start_round()
    return context.fit_in_turn(table, requests_beside(table, context, parent, likely[FITTED_FIRST:]), is_needed)


def requests_beside(
    table: CandidateTable, context: SearchContext, parent: CandidateFit, names: Iterable[str]
) -> list[FitRequest]:
    """Return the fits of one more effect beside a parent, for those that the table does not have.

    An effect with initial guesses from the data is fitted from fresh initial conditions, because segments join only under the
    right guess; the others start from those of the parent.
    """
    requests = []
    for name in names:
        if table.get(parent.names | {name}) is None and EFFECTS[name].guesses_from_data:
            requests += _guessed_requests(table, context, parent, name)
        elif table.get(parent.names | {name}) is None:
            requests += context.requests(table, parent.values, name, [{}], context.segment_starts(parent))
    return requests


def _guessed_requests(
    table: CandidateTable, context: SearchContext, parent: CandidateFit, name: str
) -> list[FitRequest]:
    return context.requests(table, parent.values, name, context.guesses(name, parent))


def parents(table: CandidateTable, context: SearchContext, size: int) -> list[CandidateFit]:
    """The best fits of a size, to which effects are added."""
    ranked = table.ranked(size)
    most = MAX_PARENTS if size == len(context.baseline_effects) + 1 else 1
    return [fit for fit in ranked[:most] if fit.fit.chi2 < MAX_PARENT_CHI2_RATIO * ranked[0].fit.chi2]


def baseline_of(table: CandidateTable, context: SearchContext) -> CandidateFit:
    """The fit that has the baseline effects alone."""
    return table.fits[frozenset(context.baseline_effects)]


def fit_guessed_effects(table: CandidateTable, context: SearchContext, parent: CandidateFit) -> CandidateTable:
    """Fit the effects beside a parent that are guessed from its residual, until one explains the log."""
    names = [name for name in EFFECTS.choose(is_guessed_from_residual=True) if table.get(parent.names | {name}) is None]
    for several in ([name for name in names if name != DoublePendulum.name], [DoublePendulum.name]):
        if not table.is_explained:  # to choose between the guesses of a double pendulum takes longer than most searches
            requests = [each for name in several for each in _guessed_requests(table, context, parent, name)]
            table = context.fit_in_turn(table, requests, lambda now, _: not now.is_explained)
    return table


def fit_bodies(table: CandidateTable, context: SearchContext) -> CandidateTable:
    """Fit a heavy rope, and a pivot that yields or holds before it slides, where the data show one: pairs imitate each."""
    if context.setting.log.has_large_amplitude:
        return table
    for name in EFFECTS.choose(structure=ModelStructure.HEAVY_ROPE):
        if not table.is_explained:
            table = _fit_beyond_its_equivalent(table, context, name)
    for structure in (ModelStructure.YIELDING_PIVOT, ModelStructure.PRESLIDING):
        for name in EFFECTS.choose(structure=structure):
            if not table.is_explained:
                table = context.fit_in_turn(table, _guessed_requests(table, context, baseline_of(table, context), name))
    return table


def _fit_beyond_its_equivalent(table: CandidateTable, context: SearchContext, name: str) -> CandidateTable:
    """Fit an effect that coincides with a simpler one where that closes most of the gap, or where the residual shows it."""
    effect, base = EFFECTS[name], baseline_of(table, context)
    of = effect.coincides_with or ""
    simpler = table.get(base.names | {of})
    nearest = base if simpler is None or simpler.fit.chi2 > base.fit.chi2 else simpler
    guesses = list(context.guesses(name, nearest))
    if nearest is simpler and nearest.reduced_chi2 - 1 < MOST_OF_GAP * (base.reduced_chi2 - 1):
        same = effect.equivalent_values(nearest.values[of], context.setting.rig.length_m)
        guesses += [] if same is None else [same]
    return context.fit_in_turn(table, context.requests(table, base.values, name, guesses))


MAX_WINDOW_REMAINDER = 0.6
"""Share of the best fit's gap that a scanned window may leave for events to be fitted in it."""
MAX_LENGTH_WINDOW_REMAINDER = 1.3
"""The same where the rope changes its length: samples respond far from linearly then, and the scan predicts too little."""
MAX_EVENT_EXCESS = 0.2
"""Excess of the reduced chi-square outside of an event that still counts as one motion before and another after it."""
MAX_REFINED_EXCESS_RATIO = 5.0
"""Excess of the reduced chi-square over that of the best fit: a fit with more does not become the best by converging."""
STRETCH = 1.6
"""Factor on an event's duration; it and its square are tried both ways: a short strong event is much like a long weak one, and
fits end between them."""


def has_event(table: CandidateTable, context: SearchContext) -> bool:
    """Whether the log is one motion before an event and another after it; no clock error and no lost sample does that.

    Beside known inputs of the crane this is taken to be so.
    """
    if context.setting.crane_inputs:
        return True
    base, n_values = baseline_of(table, context), context.setting.log.n_values
    between = context.changepoints(base, length=True)
    return between is not None and between.remaining_chi2 < (1 + MAX_EVENT_EXCESS) * n_values


def fit_events_in_windows(table: CandidateTable, context: SearchContext, parent: CandidateFit) -> CandidateTable:
    """Fit events beside a parent where separate motions before and after a window promise a good fit."""
    setting, log = context.setting, context.setting.log
    is_baseline = len(parent.values) == len(context.baseline_effects)
    for changes_length in (False, True):
        windows = _scan(context, parent, length=changes_length)
        between = context.changepoints(parent, length=changes_length)
        lenient = changes_length and (between is not None or is_baseline)
        share = MAX_LENGTH_WINDOW_REMAINDER if lenient else MAX_WINDOW_REMAINDER
        places = (*windows, *([] if between is None else [between]))
        remaining = min((place.remaining_chi2 for place in places), default=np.inf)
        gap = table.best.fit.chi2 - log.n_values
        if remaining - log.n_values >= max(share * gap, EXCESS_SIGNIFICANT * log.n_values):
            continue
        guess_context = setting.guess_context(log.force_g - parent.fit.force_g, windows, between)
        starts = context.segment_starts(parent)
        requests = [
            each
            for name in EFFECTS.choose(transient=True, found_before_search=False, changes_length=changes_length)
            for each in context.requests(
                table, parent.values, name, EFFECTS[name].initial_guesses(guess_context), starts
            )
        ]
        table = context.fit_in_turn(table, requests)
    return table


def refine(table: CandidateTable, context: SearchContext, size: int) -> CandidateTable:
    """Continue the best fits of a size that converge slowly, and try their events shorter and longer."""
    table = table.start_round()
    for candidate in table.ranked(size)[:MAX_PARENTS]:
        excess_ratio = (candidate.reduced_chi2 - 1) / max(table.closest.reduced_chi2 - 1, EXCESS_SIGNIFICANT)
        converges_slowly = any(EFFECTS[name].transient or EFFECTS[name].slow_convergence for name in candidate.values)
        if excess_ratio > MAX_REFINED_EXCESS_RATIO or not converges_slowly:
            continue
        if table.is_explained or context.budget.is_exhausted:
            break
        table = context.fit(table, candidate.values, iterations=REFINE_ITERATIONS)
        refined = table.fits[candidate.names]
        stretched = [
            FitRequest({**refined.values, name: changed}, None, REFINE_ITERATIONS, give_up_above=table.give_up_above)
            for name in sorted(refined.names)
            for changed in _stretched(EFFECTS[name], refined.values[name])
        ]
        table = context.fit_in_turn(table, stretched, lambda now, _: needs_more(now.best, context))
    return table


def needs_more(fit: CandidateFit, context: SearchContext) -> bool:
    """Whether a residual remains outside of events whose exact course is not modelled."""
    if not fit.has_unexplained_residual:
        return False
    return warrants_another_effect(exclude_unmodelled_profiles(context.setting.log, fit.values), fit.fit)


def _scan(context: SearchContext, parent: CandidateFit, *, length: bool) -> tuple[EventWindow, ...]:
    """Scan for changepoints of the tilts and rates; with `length` also of the rope's length."""
    setting, log = context.setting, context.setting.log
    extra = (RopeLength.name,) if length and RopeLength.name not in parent.values else ()
    simulator, at = setting.at_rest_beside(parent.fit, parent.values, extra)
    chosen = [*range(HEADING), *(i for i, spec in enumerate(simulator.parameters) if spec.effect in extra)]
    residual = log.residual_sigma(parent.fit.force_g)
    return scan_for_changepoints(log.time_s, residual, sensitivities_sigma(simulator, at, log)[..., chosen], log.used)


def _stretched(effect: Effect, values: Values) -> Iterable[Values]:
    """The event shorter and longer about the same middle."""
    start, lengths = effect.names_of(ParameterKind.START), effect.names_of(ParameterKind.DURATION)
    if not effect.transient or not start or len(lengths) != 1:
        return
    start_s, duration_s = (float(np.asarray(values[key])) for key in (start[0], lengths[0]))
    for power in (2, 1, -1, -2):
        length_s = STRETCH**power * duration_s
        yield {**values, start[0]: start_s + (duration_s - length_s) / 2, lengths[0]: length_s}
