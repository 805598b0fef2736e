"""Steps that fit events: changepoints and a scan say when something may have happened, fits say what."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.guess_context import EventWindow
from gateway.twin.effects.parameter import ParameterKind, Values
from gateway.twin.effects.rope import RopeLength
from gateway.twin.reconcile.fit.fit_context import sensitivities_sigma
from gateway.twin.reconcile.fit.multiple_shooting import REFINE_ITERATIONS
from gateway.twin.reconcile.residual import EXCESS_SIGNIFICANT, warrants_another_effect
from gateway.twin.reconcile.search.candidates import CandidateFit, CandidateTable
from gateway.twin.reconcile.search.changepoints import exclude_unmodelled_profiles, scan_for_changepoints
from gateway.twin.reconcile.search.context import FitRequest, SearchContext
from gateway.twin.reconcile.search.persistent import MAX_PARENTS, baseline_of
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
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
