"""Models evaluated on the selection part of the held-out recording, each once."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from gateway.twin.effects.parameter import Value
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.reparameterised_simulator import Limits
from gateway.twin.reconcile.fit.validation import ValidationFit, evaluate_on_validation
from gateway.twin.reconcile.search.candidates import CandidateFit

Key = tuple[tuple[str, tuple[tuple[str, Value], ...]], ...]


@dataclass(slots=True)
class Validator:
    """Evaluates models on a recording and keeps the results."""

    rig: TwinRig
    model_effects: EffectValues
    """Effects that the model has already; they act beside every set that is evaluated."""
    selection: Observations
    _known: dict[Key, ValidationFit] = field(default_factory=dict)

    def evaluate(self, candidate: CandidateFit) -> ValidationFit:
        """Fit initial motion, phases and heading under a set of effects; everything else stays as it is."""
        chosen = self.effects_of(candidate)
        key = _key(chosen)
        if key not in self._known:
            self._known[key] = evaluate_on_validation(
                self.rig, chosen, self.selection, limits=self.limits_of(candidate)
            )
        return self._known[key]

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


def _key(values: EffectValues) -> Key:
    return tuple(sorted((name, _sorted_items(parameters)) for name, parameters in values.items()))


def _sorted_items(parameters: Mapping[str, Value]) -> tuple[tuple[str, Value], ...]:
    return tuple(sorted((key, tuple(v) if isinstance(v, (list, tuple)) else v) for key, v in parameters.items()))
