"""What a model leaves: noise, hardly more with lines in it, or something."""

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.output.result import Peak
from gateway.twin.reconcile.residual.whiteness import find_peaks

EXCESS_SIGNIFICANT = 0.03
"""Excess of the reduced chi-square that is something left; less cannot be told from a noise stated 1.5 % too low."""
EXCESS_LINES = 0.01
"""Excess below which lines are not looked for."""
EXCESS_LARGE = 0.5
"""Excess that no wrongly stated noise accounts for."""


def has_excess(observations: Observations, fit: Fit) -> bool:
    """A remainder that is no noise: louder than stated, and with lines in it or far louder."""
    excess = observations.reduced_chi2(fit.force_g) - 1
    return excess > EXCESS_LARGE or (excess > EXCESS_SIGNIFICANT and bool(residual_lines(observations, fit)))


def has_lines(observations: Observations, fit: Fit) -> bool:
    """Lines in what is left, though it is hardly louder than noise."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_LINES and bool(residual_lines(observations, fit))


def warrants_another_effect(observations: Observations, fit: Fit) -> bool:
    """Enough for a search to go on: louder than stated, or with lines in it."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_SIGNIFICANT or has_lines(observations, fit)


def residual_lines(observations: Observations, fit: Fit) -> tuple[Peak, ...]:
    """Of what is left."""
    return find_peaks(observations.time_s, observations.residual_sigma(fit.force_g), observations.noise_g)
