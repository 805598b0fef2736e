"""Tests whether the residual of a fit is noise."""

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.output.result import Peak
from gateway.twin.reconcile.residual.whiteness import find_peaks

EXCESS_SIGNIFICANT = 0.03
"""Excess of the reduced chi-square over 1 that is significant: a stated noise that is 1.5 % too small gives as much."""
EXCESS_LINES = 0.01
"""Excess from which spectral lines are sought: less is within the scatter of noise alone."""
EXCESS_LARGE = 0.5
"""Excess that no wrongly stated noise explains: it would have to be stated 22 % too small."""


def has_excess(observations: Observations, fit: Fit) -> bool:
    """Return whether the residual is more than noise: significantly larger and with lines, or much larger."""
    excess = observations.reduced_chi2(fit.force_g) - 1
    return excess > EXCESS_LARGE or (excess > EXCESS_SIGNIFICANT and bool(residual_lines(observations, fit)))


def has_lines(observations: Observations, fit: Fit) -> bool:
    """Return whether the residual has spectral lines, even if it is hardly larger than noise."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_LINES and bool(residual_lines(observations, fit))


def warrants_another_effect(observations: Observations, fit: Fit) -> bool:
    """Return whether a search should continue: the residual is significantly larger than noise, or has lines."""
    return observations.reduced_chi2(fit.force_g) > 1 + EXCESS_SIGNIFICANT or has_lines(observations, fit)


def residual_lines(observations: Observations, fit: Fit) -> tuple[Peak, ...]:
    """Return the spectral lines of the residual, strongest first."""
    return find_peaks(observations.time_s, observations.residual_sigma(fit.force_g), observations.noise_g)


def excess_chi2(observations: Observations, fit: Fit) -> float:
    """Return the chi-square of the residual beyond the largest that noise gives, 0 or more."""
    largest = (1 + EXCESS_SIGNIFICANT) * observations.n_values
    return max(0.0, float((observations.residual_sigma(fit.force_g) ** 2).sum()) - largest)
