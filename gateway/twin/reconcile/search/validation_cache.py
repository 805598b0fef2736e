"""Models evaluated on the selection part of the held-out recording, each once."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from gateway.twin.effects.parameter import Value
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.validation import ValidationFit, evaluate_on_validation

Key = tuple[tuple[str, tuple[tuple[str, Value], ...]], ...]


@dataclass(slots=True)
class Validator:
    """Evaluates models on a recording and keeps the results."""

    rig: TwinRig
    model_effects: EffectValues
    """Effects that the model has already; they act beside every set that is evaluated."""
    selection: Observations
    _known: dict[Key, ValidationFit] = field(default_factory=dict)

    def evaluate(self, values: EffectValues) -> ValidationFit:
        """Fit initial motion, phases and heading under a set of effects; everything else stays as it is."""
        chosen = {**self.model_effects, **values}
        key = _key(chosen)
        if key not in self._known:
            self._known[key] = evaluate_on_validation(self.rig, chosen, self.selection)
        return self._known[key]


def _key(values: EffectValues) -> Key:
    return tuple(sorted((name, _sorted_items(parameters)) for name, parameters in values.items()))


def _sorted_items(parameters: Mapping[str, Value]) -> tuple[tuple[str, Value], ...]:
    return tuple(sorted((key, tuple(v) if isinstance(v, (list, tuple)) else v) for key, v in parameters.items()))
