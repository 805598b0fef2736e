"""The prior of a fit: what parts, clamps and tape measures leave open, as Gaussian pseudo-observations of effect values."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NormalPrior:
    """Independent normal distributions of the values of a simulator."""

    centre: Array
    """Shape (values,)."""
    precision: Array
    """One over the variance, 0 where nothing is known, shape (values,)."""

    def of_effects(self, n_initial_states: int) -> "NormalPrior":
        """Return the prior of the effect values alone."""
        return NormalPrior(self.centre[n_initial_states:], self.precision[n_initial_states:])

    def chi2(self, values: Array) -> float:
        """Return the sum of the squared deviations of values (values,) in standard deviations."""
        return float((self.precision * (values - self.centre) ** 2).sum())

    def pull(self, values: Array) -> Array:
        """Return half of the negative gradient of `chi2`, shape (values,)."""
        pull: Array = self.precision * (self.centre - values)
        return pull


def no_prior(simulator: Simulator) -> NormalPrior:
    """Return the prior that knows nothing."""
    return NormalPrior(np.zeros(len(simulator.parameters)), np.zeros(len(simulator.parameters)))


def prior_of_parts(simulator: Simulator) -> NormalPrior:
    """Return the prior by the usual limits of parts and mounts, and of the rig's lengths, each as one standard deviation.

    So wide a prior decides nothing that the data decide; it holds the sums that they do not determine, such as an offset along
    the rope beside a scale error.
    """
    sigma = np.full(len(simulator.parameters), np.inf)
    for i, spec in enumerate(simulator.parameters):
        for parameter in EFFECTS[spec.effect].parameters if spec.effect else ():
            if parameter.name == spec.parameter:
                sigma[i] = parameter.limit or parameter.prior_sigma or np.inf
    return NormalPrior(np.array([spec.neutral for spec in simulator.parameters]), sigma**-2.0)
