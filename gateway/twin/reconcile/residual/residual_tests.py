"""What a model leaves: noise, hardly more with lines in it, or something."""

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.output.result import Peak
from gateway.twin.reconcile.residual.whiteness import peaks

OPEN = 0.03
"""Excess of the reduced chi-square that is something left; less cannot be told from a noise stated 1.5 % too low."""
HARDLY = 0.01
"""Excess below which lines are not looked for."""
MUCH_LEFT = 0.5
"""Excess that no wrongly stated noise accounts for."""


def left_open(observations: Observations, fit: Fit) -> bool:
    """A remainder that is no noise: louder than stated, and with lines in it or far louder."""
    excess = observations.reduced_chi2(fit.force_g) - 1
    return excess > MUCH_LEFT or (excess > OPEN and bool(lines(observations, fit)))


def structured(observations: Observations, fit: Fit) -> bool:
    """Lines in what is left, though it is hardly louder than noise."""
    return observations.reduced_chi2(fit.force_g) > 1 + HARDLY and bool(lines(observations, fit))


def to_go_on_with(observations: Observations, fit: Fit) -> bool:
    """Enough for a search to go on: louder than stated, or with lines in it."""
    return observations.reduced_chi2(fit.force_g) > 1 + OPEN or structured(observations, fit)


def lines(observations: Observations, fit: Fit) -> tuple[Peak, ...]:
    """Of what is left."""
    return peaks(observations.time_s, observations.residual_sigma(fit.force_g), observations.noise_g)
