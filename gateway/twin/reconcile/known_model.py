"""The model that is known before a search: the rig's, and what the crane did in the recordings."""

from dataclasses import dataclass

from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.crane_inputs import CraneInputs


@dataclass(frozen=True, slots=True)
class KnownModel:
    """What is known before the search: the model of the rig, and what the crane did in each recording."""

    model: Model
    inputs: CraneInputs
    held_out_inputs: CraneInputs
    """The same as `inputs` where the held-out part is the end of the log."""

    @property
    def of_log(self) -> Model:
        """The model on the log."""
        return Model(self.model.rig, {**self.model.effects, **self.inputs.values})

    @property
    def held_out_effects(self) -> EffectValues:
        """The effects that the model has on the held-out recording."""
        return {**self.model.effects, **self.held_out_inputs.values}
