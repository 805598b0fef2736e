"""Models evaluated on the selection part of the held-out recording, each once."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.reparameterisation import Limits
from gateway.twin.reconcile.fit.validation import ValidationFit, block_bootstrap_gain, evaluate_on_validation
from gateway.twin.reconcile.search.candidates import MIN_VARIANCE_SHARE, CandidateFit
from gateway.twin.reconcile.search.parallel_fits import run_in_processes, values_key

Array = NDArray[np.float64]


@dataclass(slots=True)
class Validator:
    """Evaluates models on a recording and keeps the results."""

    rig: TwinRig
    model_effects: EffectValues
    """Effects that the model has already; they act beside every set that is evaluated."""
    selection: Observations
    processes: int = 1
    """Processes for models that are evaluated together."""
    _known: dict[tuple[object, ...], ValidationFit] = field(default_factory=dict)

    def evaluate(self, candidate: CandidateFit) -> ValidationFit:
        """Fit initial motion, phases and heading under a set of effects; everything else stays as it is."""
        key = values_key(self.effects_of(candidate))
        if key not in self._known:
            self._known[key] = self._fit(candidate)
        return self._known[key]

    def evaluate_ahead(self, candidates: Iterable[CandidateFit]) -> None:
        """Evaluate at once what is about to be asked for."""
        new = {values_key(self.effects_of(each)): each for each in candidates}
        new = {key: each for key, each in new.items() if key not in self._known}
        if min(self.processes, len(new)) > 1:
            fitted = run_in_processes([partial(self._fit, each) for each in new.values()], self.processes)
            self._known.update(zip(new, fitted, strict=False))

    def _fit(self, candidate: CandidateFit) -> ValidationFit:
        chosen, limits = self.effects_of(candidate), self.limits_of(candidate)
        return evaluate_on_validation(self.rig, chosen, self.selection, limits=limits)

    def is_improved(self, before: ValidationFit, after: ValidationFit, random: np.random.Generator) -> bool:
        """Return whether less remains on the recording, by more than chance and enough to matter."""
        used, residual_sigma = self.selection.used, self.selection.residual_sigma
        left_before, left_after = (residual_sigma(each.fit.force_g)[used] for each in (before, after))
        low, _ = block_bootstrap_gain(left_before, left_after, self.selection.interval_s, random)
        return low > 0 and before.reduced_chi2 - after.reduced_chi2 > MIN_VARIANCE_SHARE

    def limits_of(self, candidate: CandidateFit) -> Limits:
        """Return the bounds of the rope's length, where a hoist in the log has changed it."""
        return {
            label: each for label, each in candidate.length_limits.items() if label.split(".")[0] in self.model_effects
        }

    def effects_of(self, candidate: CandidateFit) -> EffectValues:
        """Return all effects of a model on the recording.

        Inputs of the crane that acted earlier in the same recording keep their corrections from the log.
        """
        inputs = {name: each for name, each in candidate.crane_inputs.items() if name in self.model_effects}
        return {**self.model_effects, **inputs, **candidate.values}
