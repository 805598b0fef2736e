"""The whole workflow: load, fit the nuisances, locate, rank, search, judge on held-out data, answer."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects.effect import Value
from gateway.twin.model import Model
from gateway.twin.reconcile.data.artefact_detectors import mean_of_steps
from gateway.twin.reconcile.data.data_checks import Loaded
from gateway.twin.reconcile.data.observations import Observations, Recordings
from gateway.twin.reconcile.decision.ambiguity_groups import is_beyond
from gateway.twin.reconcile.decision.verdict import RIVAL, Contender, decide
from gateway.twin.reconcile.fit.fit_context import Setting
from gateway.twin.reconcile.fit.validation import judge
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.result_builder import Findings, reconciliation
from gateway.twin.reconcile.residual.isolability import coinciding
from gateway.twin.reconcile.residual.residual_tests import left_open
from gateway.twin.reconcile.residual.surrogate_test import largest_by_chance, score
from gateway.twin.reconcile.search.baseline import SAME_GAIN, based, recordings_of, seen_in_readings
from gateway.twin.reconcile.search.candidate_fits import Attempt
from gateway.twin.reconcile.search.search import Search
from gateway.twin.reconcile.search.validation_search import beside
from gateway.twin.reconcile.timing.sample_loss import lost_samples, retimed_held_out

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
JUDGED = 4
NEAR = 5.0
"""Sets within this many times `RIVAL` of the best on the log are judged on held-out data."""


def reconcile(
    model: Model,
    log: Loaded,
    held_out: Loaded | None,
    *,
    seed: int = 0,
    tick: Callable[[str], None] = lambda _stage: None,
) -> Reconciliation:
    """Find what is missing; `tick` is told of each stage and each step of a fit."""
    fault = log.fault or (None if held_out is None or held_out.fault is None else f"held-out: {held_out.fault}")
    if fault is not None or log.observations is None:
        return unusable(model, log, fault or "no samples")
    recordings = recordings_of(log.observations, None if held_out is None else held_out.observations)
    recordings, always = seen_in_readings(recordings)
    rng = np.random.default_rng(seed)
    tick("baseline")
    believed = _search(model, recordings.log, {}, tick)
    start = believed.try_values({})
    if start is None:
        return unusable(model, log, "the model as believed cannot be fitted")
    search, base, recordings, lost = _singles(believed, start, recordings, always)
    best = search.run(base, search.best())
    wandering = lost is None and not search.has_event(base) and _runs_slow(search, best, recordings.held_out)
    again = _at_true_times(search, best, recordings, always) if wandering else None
    if again is not None:
        search, base, recordings, lost = again
        best = search.run(base, search.best())
    if not (_beyond_chance(search, base, best, rng) and _beyond_steps(search, base, best)):
        best = base
    tick("held-out")
    best = beside(search, best, recordings.held_out, rng)
    contenders, base_contender = judged(search, best, recordings, frozenset(base.values))
    seen = frozenset({"sample_loss"} if lost is not None else ())
    answer = decide(
        contenders,
        base_contender,
        recordings.log,
        recordings.held_out,
        frozenset(base.values),
        seen,
        search.attempts,
        rng,
        frozenset() if search.signatures is None else coinciding(search.signatures.of),
    )
    before = judge(model.rig, model.effects, recordings.held_out_as_stamped)
    findings = Findings(model, recordings, search, start, before, contenders, answer, lost)
    return reconciliation(findings, log.counts, rng)


def _search(model: Model, log: Observations, always: Values, tick: Callable[[str], None]) -> Search:
    return Search(Setting(model.rig, model.effects, log, lambda: tick("search")), always)


def _singles(
    believed: Search, start: Attempt, recordings: Recordings, always: Values
) -> tuple[Search, Attempt, Recordings, float | None]:
    """Single effects beside what the readings themselves show; again at true times where samples were lost."""
    search, base = based(believed, start, always, recordings.held_out)
    slow_clock = _slow_clock(search, search.lasting(base))
    found = None
    if not search.has_event(base) and slow_clock is not None and search.best().open:
        found = _at_true_times(search, slow_clock, recordings, always)
    if found is not None:
        return found
    search.singles(base)
    return search, base, recordings, None


def _slow_clock(search: Search, best: Attempt) -> Attempt | None:
    """Beside what is always there; where that hides the clock, beside the best that acts all the time.

    The latter is for a look only: the search does not begin with a pair.
    """
    alone = search.attempts.get(frozenset({*search.always, "clock_drift"}))
    if alone is not None or not best.open:
        return alone
    return Search(search.setting, search.always).try_values({**best.values, "clock_drift": {}})


def _runs_slow(search: Search, best: Attempt, held_out: Observations) -> bool:
    """With a clock that does not explain both recordings."""
    if "clock_drift" not in best.values:
        return False
    rig, values = search.setting.rig, {**search.setting.believed, **best.values}
    return best.open or left_open(held_out, judge(rig, values, held_out).fit)


def _at_true_times(
    search: Search, slow_clock: Attempt, recordings: Recordings, always: Values
) -> tuple[Search, Attempt, Recordings, float | None] | None:
    """Single effects once more where samples turn out to be lost; None where none are."""
    lost = lost_samples(search.setting, slow_clock)
    if lost is None:
        return None
    held_out = retimed_held_out(search.setting, lost, recordings.held_out)
    recordings = replace(recordings, log=lost.walk.retimed(recordings.log), held_out=held_out)
    again = Search(replace(search.setting, log=recordings.log), {})
    start = again.try_values({})
    if start is None:
        return None
    search, base = based(again, start, {name: search.always[name] for name in always}, held_out)
    search.lasting(base)
    search.singles(base)
    return search, base, recordings, lost.walk.fraction


def _beyond_chance(search: Search, base: Attempt, best: Attempt, rng: np.random.Generator) -> bool:
    """More than noise of the residual's own colour reaches with any effect."""
    if best is base or search.signatures is None:
        return False
    residual = search.setting.log.residual_sigma(best.fit.force_g)
    reached = score(base.fit.chi2 - best.fit.chi2, max(1, best.parameters - base.parameters))
    return reached > largest_by_chance(search.signatures.of, residual, rng)


def _beyond_steps(search: Search, base: Attempt, best: Attempt) -> bool:
    """With readings in coarse steps, the gain holds against the mean of the steps: else it only imitates them."""
    if "quantization" not in base.values or best is base:
        return True
    log, rig = search.setting.log, search.setting.rig
    step_g = float(np.asarray(base.values["quantization"]["lsb_g"]))

    def stepped(attempt: Attempt) -> float:
        return log.reduced_chi2(mean_of_steps(attempt.fit.force_g, step_g, np.array(rig.noise_g)))

    return stepped(base) - stepped(best) > SAME_GAIN * (base.reduced - best.reduced)


def judged(
    search: Search, best: Attempt, recordings: Recordings, always: frozenset[str]
) -> tuple[list[Contender], Contender]:
    """The sets near the best on the log, judged on the held-out recording, best first; and the base."""
    setting, unit = search.setting, search.unit()
    least = search.bic(best, unit)
    ranked = sorted(search.attempts.values(), key=lambda a: search.bic(a, unit))
    near = [
        a
        for a in ranked
        if not is_beyond(a.names, best.names) and always <= a.names and search.bic(a, unit) < least + NEAR * RIVAL
    ]

    def contender(attempt: Attempt) -> Contender:
        found = judge(setting.rig, {**setting.believed, **attempt.values}, recordings.held_out)
        return Contender(attempt, found, search.bic(attempt, unit), 0.0)

    found = [contender(a) for a in [best, *near[: JUDGED - 1]]]
    start = contender(search.attempts[always])
    evidence = [c.bic + c.judged.fit.chi2 / unit for c in found]
    order = np.argsort(evidence)
    return [replace(found[i], behind=evidence[i] - evidence[order[0]]) for i in order], start


def unusable(model: Model, log: Loaded, fault: str) -> Reconciliation:
    """The answer where nothing can be said."""
    return Reconciliation(
        verdict="data_unusable",
        reason=fault,
        rig=model.rig,
        effects=(),
        candidates=(),
        split_by=None,
        disagreement=(),
        gap=None,
        residual=None,
        steps=(),
        scores=(),
        ranking=(),
        confusable=(),
        equations_before=(),
        equations_after=(),
        log=None,
        held_out=None,
        held_out_is_last_third=False,
        refitted_on_held_out=(),
        counts=log.counts,
        model=model.effects,
    )
