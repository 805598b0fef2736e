"""Sets of effects that were fitted to the log: each is kept with its evidence, and says whether it is worth its names."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.fit.fit_context import SEARCH_ITERATIONS, FitContext
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.residual.noise_inflation import noise_inflation_factor
from gateway.twin.reconcile.residual.residual_tests import warrants_another_effect
from gateway.twin.simulator.compiled_model import INTEGRATION_FAILURES

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, Value]]
MAX_FITS = 60
"""Where nothing fits, the search ends with these."""
EVENT_MARGIN_S = 1.0
"""An event must begin and end this far inside the recording, or it is no event."""
MIN_VARIANCE_SHARE = 0.002
"""Share of the noise's variance that an effect must take off the residual to be worth a name."""
MIN_SCORE_STATISTIC = 25.0
"""Chi-square over the noise's colour that an effect must take off: 1 in 10^5 for four parameters, times the family."""


@dataclass(frozen=True, slots=True)
class CandidateFit:
    """A set of effects, fitted to the log."""

    values: Values
    fit: Fit
    reduced_chi2: float
    parameters: int
    has_unexplained_residual: bool
    """Something is left."""

    @property
    def names(self) -> frozenset[str]:
        """The set."""
        return frozenset(self.values)


@dataclass(slots=True)
class CandidateTable:
    """All so far."""

    setting: FitContext
    baseline_effects: Values
    """Effects found without fitting; every attempt has them."""
    candidates: dict[frozenset[str], CandidateFit] = field(default_factory=dict)
    fits: int = 0

    def fit_candidate(
        self, values: Values, starts: Array | None = None, rounds: int = SEARCH_ITERATIONS, beyond: float = np.inf
    ) -> CandidateFit | None:
        """Fit a set from these values; the better one is kept where the set was fitted before. None where it cannot be."""
        setting = self.setting
        self.fits += 1
        try:
            fit = setting.fit(values, starts, rounds, beyond)
        except INTEGRATION_FAILURES:
            return None  # the fit ran to parameters that no integration can follow
        if not np.isfinite(fit.chi2):
            return None
        model = setting.simulator(tuple(values)).effects(fit.values)
        fitted = {name: model[name] for name in values}
        if not all(_is_inside_recording(name, fitted[name], setting.log.duration_s) for name in values):
            return None
        simulator = setting.simulator(tuple(values))
        parameters = sum(slot.effect in values for slot in simulator.parameters) + simulator.n_initial_states - 5
        found = CandidateFit(
            fitted, fit, fit.chi2 / setting.log.n_values, parameters, warrants_another_effect(setting.log, fit)
        )
        known = self.candidates.get(found.names)
        if known is None or found.reduced_chi2 < known.reduced_chi2:
            self.candidates[found.names] = found
        return self.candidates[found.names]

    def best(self) -> CandidateFit:
        """By BIC over the colour of the noise of the best-fitting."""
        chi2_unit = self.noise_inflation()
        return min(self.candidates.values(), key=lambda a: self.bic(a, chi2_unit))

    def noise_inflation(self) -> float:
        """Colour of what the best-fitting attempt leaves."""
        least = min(self.candidates.values(), key=lambda a: a.reduced_chi2)
        return noise_inflation_factor(self.setting.log.time_s, self.setting.log.residual_sigma(least.fit.force_g))

    def bic(self, attempt: CandidateFit, unit: float) -> float:
        """Chi-square over the noise's colour + parameters x ln(numbers)."""
        return attempt.fit.chi2 / unit + attempt.parameters * math.log(self.setting.log.n_values)

    @property
    def is_budget_exhausted(self) -> bool:
        """So many fits have been made that what is still to find is no single effect and no pair."""
        return self.fits >= MAX_FITS

    def is_significant(self, before: CandidateFit, after: CandidateFit) -> bool:
        """The gain is large enough for a name, and no accident."""
        gain = before.fit.chi2 - after.fit.chi2
        more = max(1, after.parameters - before.parameters)
        statistic = gain / self.noise_inflation() / (1 + 0.1 * more)
        return gain > MIN_VARIANCE_SHARE * self.setting.log.n_values and statistic > MIN_SCORE_STATISTIC


def _is_inside_recording(name: str, values: Mapping[str, Value], duration_s: float) -> bool:
    """Whether a transient effect begins and ends inside the recording, and lasts as long as such effects do."""
    interval_s = EFFECTS[name].interval_s(values)
    if interval_s is None:
        return True
    start_s, end_s = interval_s
    if end_s - start_s < EFFECTS[name].min_duration_s:
        return False
    return start_s >= EVENT_MARGIN_S and end_s <= duration_s - EVENT_MARGIN_S
