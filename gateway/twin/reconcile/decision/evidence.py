"""The facts that a verdict rests on, each with a name."""

from collections.abc import Mapping
from dataclasses import dataclass

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.changepoints.changepoint_scan import exclude_unmodelled_profiles
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.ranking import RankedCandidate
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.residual.residual_tests import EXCESS_LINES, has_excess, has_lines
from gateway.twin.reconcile.search.candidates import CandidateFit

MIN_GAP_CLOSED = 0.99
"""Share of the gap on the selection part that effects must close to be named although a residual remains."""
MIN_GAP_CLOSED_BOTH = 0.999
"""Of a large swing, the share of both recordings' gaps together: one that decays leaves little of the gap to its end."""
MIN_GAP_CLOSED_SELECTION = 0.95
"""The least share on the selection part that goes with `MIN_GAP_CLOSED_BOTH`."""
MIN_GAP_CLOSED_USUAL = 0.9
"""The same, on the log as well, for causes that every rig has to some degree: they are expected, so less proves them."""
MIN_NECESSARY_SHARE = 0.1
"""Share of the gap that the absence of an effect must leave open for the effect to be necessary."""
MIN_NECESSARY_RATIO = 30.0
"""Of a large swing, the factor on chi-square instead: the first loss alone closes nearly all of its gap."""
MIN_EXCESS_RATIO = 10.0
"""Factor by which the absence of a necessary effect multiplies the excess that the set leaves; an imitation halves it."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is known of the ranked sets of effects."""

    best: RankedCandidate
    baseline: RankedCandidate
    rivals: list[RankedCandidate]
    """The best set and all that the evidence does not separate from it."""
    detected: frozenset[str]
    """Effects found without a model: they count as named."""
    improves_selection: bool
    """The best set leaves less than the baseline on the selection part, by more than chance."""
    best_leaves_excess: bool
    baseline_leaves_excess: bool
    """A residual larger than noise remains on the log or, of the best set, on the selection part."""
    best_leaves_lines: bool
    """Spectral lines remain although hardly more than noise is left."""
    necessary: frozenset[str]
    """Effects of the best set whose absence leaves a share of the gap open."""
    baseline_closes_gap: bool
    """The effects found without a search close a share of the gap of the nominal model; coarse steps alone close nothing."""
    closes_gap: bool
    """The best set closes nearly all of the gap on the selection part."""
    is_usual: bool
    """The best set consists of causes that every rig has to some degree, and closes most of the gap on both parts."""

    @property
    def baseline_names(self) -> frozenset[str]:
        """Effects found without a search."""
        return self.baseline.names

    @property
    def n_added(self) -> int:
        """Effects of the best set beyond the baseline."""
        return len(self.best.names - self.baseline_names)


def gather_evidence(
    best: RankedCandidate,
    baseline: RankedCandidate,
    nominal: RankedCandidate,
    rivals: list[RankedCandidate],
    log: Observations,
    selection: Observations,
    fits: Mapping[frozenset[str], CandidateFit],
    detected: frozenset[str],
    *,
    improves_selection: bool,
    large_amplitude: bool,
) -> Evidence:
    """Compute the facts. Samples in events whose exact course is not modelled count for no residual."""
    seen_log, seen_selection = (exclude_unmodelled_profiles(each, best.candidate.values) for each in (log, selection))
    on_both: tuple[tuple[Observations, Fit], ...] = (
        (seen_log, best.candidate.fit),
        (seen_selection, best.validation.fit),
    )
    return Evidence(
        best=best,
        baseline=baseline,
        rivals=rivals,
        detected=detected,
        improves_selection=improves_selection,
        best_leaves_excess=any(has_excess(*each) for each in on_both),
        baseline_leaves_excess=has_excess(seen_log, baseline.candidate.fit),
        best_leaves_lines=any(has_lines(*each) for each in on_both),
        necessary=_necessary_effects(best, baseline, fits, large_amplitude=large_amplitude),
        baseline_closes_gap=_baseline_closes_gap(baseline.candidate, fits),
        closes_gap=_closes_gap(best, baseline, large_amplitude=large_amplitude),
        is_usual=_is_usual(best, baseline, nominal),
    )


def _necessary_effects(
    best: RankedCandidate,
    baseline: RankedCandidate,
    fits: Mapping[frozenset[str], CandidateFit],
    *,
    large_amplitude: bool,
) -> frozenset[str]:
    gap = baseline.candidate.fit.chi2 - best.candidate.fit.chi2
    found = set(baseline.names)
    for name in best.names - baseline.names:
        without = fits.get(best.names - {name})
        if without is None:
            found.add(name)
            continue
        leaves_gap = without.fit.chi2 - best.candidate.fit.chi2 > MIN_NECESSARY_SHARE * gap
        multiplies = without.reduced_chi2 > MIN_NECESSARY_RATIO * best.candidate.reduced_chi2
        excess = max(best.candidate.reduced_chi2 - 1, EXCESS_LINES)
        leaves_excess = without.reduced_chi2 - 1 > MIN_EXCESS_RATIO * excess
        if leaves_gap or leaves_excess or (large_amplitude and multiplies):
            found.add(name)
    return frozenset(found)


def _baseline_closes_gap(baseline: CandidateFit, fits: Mapping[frozenset[str], CandidateFit]) -> bool:
    nominal = fits.get(frozenset())
    if nominal is None or not baseline.names:
        return bool(baseline.names)
    closed = nominal.reduced_chi2 - baseline.reduced_chi2
    return closed > MIN_NECESSARY_SHARE * max(nominal.reduced_chi2 - 1, EXCESS_LINES)


def _closes_gap(best: RankedCandidate, baseline: RankedCandidate, *, large_amplitude: bool) -> bool:
    before, after = baseline.validation.reduced_chi2, best.validation.reduced_chi2
    on_selection = (before - after) / max(before - 1, 1e-9)
    if on_selection > MIN_GAP_CLOSED or not large_amplitude:
        return on_selection > MIN_GAP_CLOSED
    before += baseline.candidate.reduced_chi2
    after += best.candidate.reduced_chi2
    on_both = (before - after) / max(before - 2, 1e-9)
    return on_both > MIN_GAP_CLOSED_BOTH and on_selection > MIN_GAP_CLOSED_SELECTION


def _is_usual(best: RankedCandidate, baseline: RankedCandidate, nominal: RankedCandidate) -> bool:
    """Whether usual causes close the gap: that of the baseline, or of the nominal model where the baseline has some of them."""
    usual = set(EFFECTS.choose(is_usual=True))
    if not best.names - baseline.names <= usual:
        return False
    start = nominal if baseline.names & usual else baseline
    gaps = (
        (start.validation.reduced_chi2, best.validation.reduced_chi2),
        (start.candidate.reduced_chi2, best.candidate.reduced_chi2),
    )
    return all(before - after > MIN_GAP_CLOSED_USUAL * (before - 1) for before, after in gaps)


def nameable_with_residual(names: frozenset[str]) -> frozenset[str]:
    """Effects that may be named although a residual remains: whatever is not modelled can change the swing's rate, too."""
    return frozenset(name for name in names if not EFFECTS[name].scales_period)
