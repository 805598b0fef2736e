"""Two-filter smoothing: what the bins up to a time say is joined with what the later ones say (Fraser and Potter 1969, eq. 12).

It is done under each hypothesis, with the states whitened by what was known before the first bin. The prior is then N(0, I), and
the later bins, which have begun with it too, contribute the information P^-1 - I, so that it counts once. The hypotheses' weights
are multiplied, with the evidence that both directions agree.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.motion.filter_history import KEPT_CONSTANTS, KEPT_GRAVITY, KEPT_RATE, MixtureSeries
from gateway.motion.mixing import Mixture
from gateway.motion.motion_filter import TEMPERING
from gateway.motion.whitening import Information, Whitening
from gateway.numerics.array import Array

SWING = slice(KEPT_GRAVITY.start, KEPT_RATE.stop)
"""Angle and rate among the kept states."""
UNINFORMATIVE = 0.9
"""Variance after whitening from which on a direction counts as not measured."""
LOST = 1e-3
"""Probability that one of the directions follows a wrong motion, so that the other one alone is right."""
NEAR_BINS = 100
"""Bins before and after one whose evidence says which of the directions follows a wrong motion: ten seconds."""
LARGEST_GAIN = 5.0
"""Difference of the log evidence that one bin may make: an outlier decides nothing."""
CONSTANTS_U_FACTOR = 1.25
"""Factor of the uncertainty that the constants leave. Basis: errors of the equations are not white, so that the filter takes its
constants for better known than they are."""


@dataclass(frozen=True, slots=True)
class _Joined:
    """States given all bins, whitened, and how well the two directions agree."""

    state: Array
    covariance: Array
    log_evidence: Array
    """Logarithm of the integral of N(x; forward) N(x; backward) / N(x; prior), shape (n, m)."""
    disagreement: Array
    """Normalised squared difference of the directions over its expectation, shape (n, m)."""


def evidence_gain(forward: Array, backward: Array) -> Array:
    """Return the log evidence of the bins near each one by the forward run over that by the backward run, shapes (n,)."""
    difference = np.clip(np.nan_to_num(forward - backward), -LARGEST_GAIN, LARGEST_GAIN)
    total = np.concatenate([[0.0], np.cumsum(difference)])
    place = np.arange(len(difference))
    first, stop = np.maximum(place - NEAR_BINS, 0), np.minimum(place + NEAR_BINS + 1, len(difference))
    gain: Array = total[stop] - total[first]
    return gain


def combine(
    forward: MixtureSeries,
    backward: MixtureSeries,
    prior: Mixture,
    bins_before: Array,
    bins_after: Array,
    gain: Array,
) -> MixtureSeries:
    """Return the mixtures given all bins.

    `prior`: before any bin; `bins_before`, `bins_after`: positive, shape (n,): bins from which the series are made; `gain`: log
    evidence of the forward series over the backward one near each bin, shape (n,).
    """
    whitening = Whitening.of(prior)
    joined = _join(
        whitening.apply(forward.state, forward.covariance), whitening.apply(backward.state, backward.covariance)
    )
    covariance = _widen_constants(joined.covariance * np.maximum(joined.disagreement, 1.0)[..., None, None])
    both = MixtureSeries(*whitening.restore(joined.state, covariance), np.zeros_like(forward.weight))
    log_first, log_later = np.log(forward.weight), np.log(backward.weight)
    log_odds = 2 * np.log(bins_before / bins_after) + gain
    log_weights = np.array(
        [
            log_first + log_later - np.log(prior.weight) + TEMPERING * joined.log_evidence,
            log_first + np.log(LOST) - np.logaddexp(0.0, -log_odds)[:, None],
            log_later + np.log(LOST) - np.logaddexp(0.0, log_odds)[:, None],
        ]
    )
    merged = _merge(log_weights, both, forward, backward)
    disagreement = np.maximum(_disagreement_on_swing(forward, backward), 1.0)
    return replace(merged, covariance=merged.covariance * disagreement[:, None, None, None])


def _join(forward: tuple[Array, Array], backward: tuple[Array, Array]) -> _Joined:
    first, first_covariance = forward
    later = Information.of(*backward)
    matrix, vector, variance, along = later.matrix, later.vector, later.variance, later.along
    spread = np.eye(first.shape[-1]) + first_covariance @ matrix
    covariance = np.linalg.solve(spread, first_covariance)
    covariance = 0.5 * (covariance + covariance.swapaxes(-1, -2))
    gain = vector - np.einsum("...ij,...j->...i", matrix, first)
    state = first + np.einsum("...ij,...j->...i", covariance, gain)
    exponent = (
        2 * (vector * first).sum(axis=-1)
        - np.einsum("...i,...ij,...j->...", first, matrix, first)
        + np.einsum("...i,...ij,...j->...", gain, covariance, gain)
    )
    density = np.where(variance < 1, np.log(variance) + along**2 / variance, 0.0).sum(axis=-1)
    is_measured = variance < UNINFORMATIVE
    largest = np.where(is_measured, along**2 / (variance * np.maximum(1 - variance, 1 - UNINFORMATIVE)), 0.0)
    return _Joined(
        state,
        covariance,
        0.5 * (exponent - density - np.linalg.slogdet(spread)[1]),
        (largest.sum(axis=-1) - exponent) / np.maximum(is_measured.sum(axis=-1), 1),
    )


def _disagreement_on_swing(forward: MixtureSeries, backward: MixtureSeries) -> Array:
    """Return the normalised squared difference of angle and rate over its expectation, shape (n,).

    Over all states it would be lost among those on which the directions agree. It counts whichever direction is right: the one
    that explains the readings near does not follow from the equations either, where they have misled the other.
    """
    (first, first_covariance), (later, later_covariance) = _swing_moments(forward), _swing_moments(backward)
    difference = first - later
    solved = np.linalg.solve(first_covariance + later_covariance, difference[..., None])[..., 0]
    found: Array = (difference * solved).sum(axis=-1) / difference.shape[-1]
    return found


def _swing_moments(series: MixtureSeries) -> tuple[Array, Array]:
    """Return mean and covariance of angle and rate over the hypotheses, shapes (n, 4) and (n, 4, 4)."""
    state = series.state[..., SWING]
    mean = np.einsum("nm,nmi->ni", series.weight, state)
    deviation = state - mean[:, None]
    second_moment = series.covariance[..., SWING, SWING] + deviation[..., :, None] * deviation[..., None, :]
    return mean, np.einsum("nm,nmij->nij", series.weight, second_moment)


def _widen_constants(covariance: Array) -> Array:
    """Enlarge the part of the whitened covariance that is due to the constants."""
    with_constants = covariance[..., KEPT_CONSTANTS]
    constants = with_constants[..., KEPT_CONSTANTS, :]
    due = with_constants @ np.linalg.solve(constants, with_constants.swapaxes(-1, -2))
    widened: Array = covariance + (CONSTANTS_U_FACTOR**2 - 1) * due
    return widened


def _merge(log_weights: Array, *series: MixtureSeries) -> MixtureSeries:
    """Return one Gaussian per hypothesis with the moments of all series, `log_weights` of shape (series, n, m)."""
    weights = np.exp(log_weights - log_weights.max(axis=(0, 2), keepdims=True))
    weight = weights.sum(axis=0)
    share = np.divide(weights, weight, out=np.full_like(weights, 1 / len(series)), where=weight > 0)
    state = sum(part[..., None] * one.state for part, one in zip(share, series, strict=True))
    covariance = np.zeros_like(series[0].covariance)
    for part, one in zip(share, series, strict=True):
        deviation = one.state - state
        covariance += part[..., None, None] * (one.covariance + deviation[..., :, None] * deviation[..., None, :])
    return MixtureSeries(np.asarray(state), covariance, weight / weight.sum(axis=1, keepdims=True))
