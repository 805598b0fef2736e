"""Candidate fits: sets of effects that were fitted to the log, and the table that ranks them."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import TAIL_SHARE, StatedLimits, Value, Values, excess
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.crane_inputs import LENGTH_CORRECTION
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.intervals import standard_uncertainties
from gateway.twin.reconcile.fit.multiple_shooting import NO_LIMITS, Fit, Limits
from gateway.twin.reconcile.residual import noise_inflation_factor, warrants_another_effect
from gateway.twin.simulator.simulator import Simulator

EVENT_MARGIN_S = 1.0
"""An event begins and ends this far inside the recording: nearer to an end it cannot be told from another initial motion."""
MIN_VARIANCE_SHARE = 0.002
"""Share of the noise's variance that an effect must take off the residual to be named: below it no operator would care."""
MOST_OF_GAP = 0.5
"""Share of the gap, or of what a smaller set leaves, from which on what closes it is an answer beside a remainder, or a good part
of one."""
LITTLE_OF_GAP = 0.1
"""Share of the gap that the best set may leave for no other to be tried, and the least that a part of an answer closes."""
VALIDATED_MARGIN = 60.0
"""BIC behind the best set on the log up to which a set is evaluated on the selection part."""
MAX_EFFECTS = 3
"""Effects, or terms, of one answer: recordings of ordinary length do not separate more."""
MIN_SCORE_STATISTIC = 25.0
"""Chi-square over the noise inflation that an effect must take off: 1 in 100,000 for four parameters, times the family."""
LENGTH_SIGMAS = 4.0
"""Standard deviations within which a rope's length after a hoist is fitted again on the held-out end of the log."""
SCORE_PENALTY_PER_PARAMETER = 0.1
"""Relative increase of `MIN_SCORE_STATISTIC` with each further parameter, as the chi-square quantile grows."""


@dataclass(frozen=True, slots=True)
class CandidateFit:
    """A set of effects, fitted to the log."""

    values: EffectValues
    """Parameters of each effect of the set."""
    fit: Fit
    reduced_chi2: float
    n_parameters: int
    """Of the effects, and of the further initial states of their structure."""
    has_unexplained_residual: bool
    """The residual is larger than noise, or has lines in it: the search should continue."""
    implausibility: float = 0.0
    """Minus twice the logarithm of the prior density of the values; 0 where a part or a mount can have them."""
    crane_inputs: EffectValues = field(default_factory=dict)
    """The inputs of the crane with their corrections, which belong to the recording."""
    length_limits: Limits = field(default_factory=dict)
    """Bounds that the log sets to corrections of the rope's length, which last beyond it."""

    @property
    def names(self) -> frozenset[str]:
        """The set of effects."""
        return frozenset(self.values)

    def without(self, name: str) -> EffectValues:
        """Return the values of the other effects."""
        return {other: values for other, values in self.values.items() if other != name}


@dataclass(frozen=True, slots=True)
class Move:
    """A step from one set of effects to another that the search kept."""

    added: frozenset[str]
    dropped: frozenset[str]
    names: frozenset[str]
    reduced_chi2: float
    bic: float


@dataclass(frozen=True, slots=True)
class CandidateTable:
    """All candidate fits so far. A step of the search takes a table and returns one with more fits."""

    log: Observations
    noise_inflation: float = 1.0
    """Variance of the residual's noise in the band of the swing over white noise; fixed within a round."""
    give_up_above: float = math.inf
    """Chi-square above which a further fit is no rival to the best so far; fixed as well. Twice the best: fits still converge."""
    fits: Mapping[frozenset[str], CandidateFit] = field(default_factory=dict)
    moves: tuple[Move, ...] = ()

    def get(self, names: Iterable[str]) -> CandidateFit | None:
        """The fit of a set of effects; None where it was not fitted, or could not be."""
        return self.fits.get(frozenset(names))

    def with_fit(self, fit: CandidateFit) -> "CandidateTable":
        """Add a fit; where the set was fitted before, the better one is kept."""
        known = self.fits.get(fit.names)
        if known is not None and known.reduced_chi2 <= fit.reduced_chi2:
            return self
        return replace(self, fits={**self.fits, fit.names: fit})

    def start_round(self) -> "CandidateTable":
        """Fix the noise inflation of the next round, and where its fits give up."""
        residual = self.log.residual_sigma(self.closest.fit.force_g)
        fixed = replace(self, noise_inflation=noise_inflation_factor(self.log.time_s, residual))
        return replace(fixed, give_up_above=2 * fixed.best.fit.chi2)

    def record_move(self, before: CandidateFit, after: CandidateFit) -> "CandidateTable":
        """Note that the search continues from another set of effects."""
        if before.names == after.names:
            return self
        added, dropped = after.names - before.names, before.names - after.names
        return replace(
            self, moves=(*self.moves, Move(added, dropped, after.names, after.reduced_chi2, self.bic(after)))
        )

    def bic(self, fit: CandidateFit) -> float:
        """Bayesian information criterion: chi-square over the noise inflation + parameters x ln(values) (Schwarz 1978).

        EffectValues that no part has count against the set.
        """
        explained = fit.fit.chi2 / self.noise_inflation + fit.implausibility
        return explained + fit.n_parameters * math.log(self.log.n_values)

    def evidence(self, fit: CandidateFit, selection_chi2: float) -> float:
        """Return the BIC on the log plus chi-square on the selection part over the noise inflation: the lower, the better."""
        return self.bic(fit) + selection_chi2 / self.noise_inflation

    def ranked(self, size: int | None = None) -> list[CandidateFit]:
        """Fits by BIC, best first; with a `size`, those of sets of so many effects."""
        chosen = [fit for fit in self.fits.values() if size is None or len(fit.values) == size]
        return sorted(chosen, key=self.bic)

    @property
    def best(self) -> CandidateFit:
        """The fit with the lowest BIC."""
        return min(self.fits.values(), key=self.bic)

    @property
    def closest(self) -> CandidateFit:
        """The fit with the lowest chi-square, whatever its number of parameters."""
        return min(self.fits.values(), key=lambda fit: fit.reduced_chi2)

    @property
    def is_explained(self) -> bool:
        """Whether the best fit leaves noise."""
        return not self.best.has_unexplained_residual

    def is_significant(self, before: CandidateFit, after: CandidateFit) -> bool:
        """Whether a gain of chi-square is large enough for a name, and larger than chance."""
        gain = before.fit.chi2 - after.fit.chi2
        more = max(1, after.n_parameters - before.n_parameters)
        statistic = gain / self.noise_inflation / (1 + SCORE_PENALTY_PER_PARAMETER * more)
        return gain > MIN_VARIANCE_SHARE * self.log.n_values and statistic > MIN_SCORE_STATISTIC


def implausibility(effects: Mapping[str, Mapping[str, Value]], stated: StatedLimits) -> float:
    """Return minus twice the logarithm of the prior density, 0 where all values are within their limits; it adds to a BIC."""
    total = 0.0
    for name, values in effects.items():
        for parameter in EFFECTS[name].parameters:
            if parameter.limit is not None and parameter.name in values:
                beyond = excess(parameter, values[parameter.name], stated)
                total += float((beyond**2).sum()) / (TAIL_SHARE * parameter.limit) ** 2
    return total


def make_candidate(setting: FitContext, values: EffectValues, fit: Fit) -> CandidateFit | None:
    """Make a candidate of a fit; None where it diverged, or an event lies outside the recording."""
    if not np.isfinite(fit.chi2):
        return None
    simulator = setting.simulator(tuple(values))
    model = simulator.effects(fit.values)
    fitted = {name: model[name] for name in values}
    if not all(_is_inside_recording(name, fitted[name], setting.log.duration_s) for name in values):
        return None
    n_parameters = sum(spec.effect in values for spec in simulator.parameters)
    n_parameters += simulator.n_initial_states - setting.simulator(()).n_initial_states
    unexplained = warrants_another_effect(setting.log, fit)
    inputs = {name: model[name] for name in setting.crane_inputs}
    limits = _length_limits(simulator, fit, setting.log)
    reduced_chi2, doubt = fit.chi2 / setting.log.n_values, implausibility(fitted, setting.rig)
    return CandidateFit(fitted, fit, reduced_chi2, n_parameters, unexplained, doubt, inputs, limits)


def _length_limits(simulator: Simulator, fit: Fit, log: Observations) -> Limits:
    """Return the bounds of the fitted corrections of the rope's length by their labels."""
    chosen = [
        (i, spec) for i, spec in enumerate(simulator.parameters) if fit.free[i] and spec.name == LENGTH_CORRECTION
    ]
    if not chosen:
        return NO_LIMITS
    sigma = standard_uncertainties(fit, log)
    return {
        spec.label: (
            max(spec.lower, float(fit.values[i] - LENGTH_SIGMAS * sigma[i])),
            min(spec.upper, float(fit.values[i] + LENGTH_SIGMAS * sigma[i])),
        )
        for i, spec in chosen
    }


def _is_inside_recording(name: str, values: Values, duration_s: float) -> bool:
    """Whether a transient effect begins and ends inside the recording, and lasts as long as such effects do."""
    interval_s = EFFECTS[name].interval_s(values)
    if interval_s is None:
        return True
    start_s, end_s = interval_s
    if end_s - start_s < EFFECTS[name].min_duration_s:
        return False
    return start_s >= EVENT_MARGIN_S and end_s <= duration_s - EVENT_MARGIN_S
