"""Intervals of fitted values, under coloured noise, and with companions: effects that act as well and are too small to be named.

An estimate is a sum over the residual, theta = N^-1 J^T r, so its variance is N^-1 (sum of J(f)^2 S(f)) N^-1 with the
spectral density S of the noise: the sandwich with the long-run variance of the scores (Newey and West 1987), here by the
discrete cosine transform, which slow noise does not leak out of (Müller 2007; Lazarus et al. 2018).

A set without the companion gives its part to the values of others: drag alone takes the damping for drag. So the interval is that
of the average over the set and the set with the companion, by their evidence (Hoeting et al. 1999), and of all these the widest.
The named set counts no less than any other. A loss beside a loss counts as much: every rig has each to some degree.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext, sensitivities_sigma
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
MIN_SHARE = 1e-4
"""Share of the variance of a value, under white noise, below which the density at a frequency is not asked for."""
REACH = 6
"""Frequencies on either side (half a cycle in the recording apart) that tell of the density: the fewest that do not leave the
intervals under white noise too wide; a disturbance at the frequency of the swing is as narrow."""
EXPONENTS = (1, 2)
"""Definition: of the frequency, 1/f noise and a random walk; beside them the flat spectrum, with as much weight as each."""
N_CORNERS = 8
LONGEST_MEMORY = 1.0
"""Memory of the slowest noise over the recording's duration: a slower one belongs to the mean of the recording."""
LEVELS = 2.0 ** np.arange(21)
"""Levels of noise that is not white, over the mean square of the residual: equally likely on a logarithmic scale."""
WHITE_PROBABILITY = 0.5
"""Of the mean square of the residual to hold at a frequency as everywhere, before the frequencies around are looked at."""
BISECTIONS = 40
N_QUANTILES = 64
"""Equally likely sizes of a companion that stand for their distribution; the ends of an interval are true to 1 % of it."""


def coloured_covariance(fit: Fit, observations: Observations) -> Array:
    """Return the covariance of the free values, shape (k, k): 1.96 roots of its diagonal are their 95 % intervals.

    What the fit itself takes from the residual at the frequencies of its values is given back. The stated noise is the least.
    """
    white = fit.covariance()
    spectrum = dct(fit.jacobian[..., fit.free], axis=0, norm="ortho")  # (frequencies, 3, k)
    power = dct(observations.residual_sigma(fit.force_g), axis=0, norm="ortho") ** 2
    gains = spectrum @ white
    left = np.maximum(float(observations.used.mean()) - np.einsum("fak,fak->fa", gains, spectrum), 0.0)
    variances = gains**2
    total = variances.sum(axis=(0, 1))
    shares = variances / np.where(total > 0, total, 1.0)
    density = np.ones_like(power)
    for axis in range(density.shape[1]):
        bins = np.flatnonzero(shares[:, axis].max(axis=1) > MIN_SHARE)
        density[bins, axis] = noise_density(power[:, axis], left[:, axis], bins)
    covariance: Array = np.einsum("fa,fak,fal->kl", density, gains, gains)
    return covariance


def standard_uncertainties(fit: Fit, observations: Observations) -> Array:
    """Return those of all values, shape (values,): 0 of what was not fitted."""
    sigma = np.zeros(len(fit.values))
    sigma[fit.free] = np.sqrt(np.maximum(np.diag(coloured_covariance(fit, observations)), 0.0))
    return sigma


def noise_density(power: Array, left: Array, bins: NDArray[np.intp]) -> Array:
    """Return the density at chosen frequencies of which 1.96 roots are the 95 % interval of the noise there, shape (m,).

    `power` (n,) is that of the residual in sigma by the discrete cosine transform, `left` (n,) the share of the noise's power
    that the fit leaves. The noise is no smaller than stated: the density is at least 1.
    """
    white = max(float(power.sum() / left.sum()), np.finfo(np.float64).tiny)
    exponents, corners = _shapes()
    k = np.arange(len(power))
    log_shape = -exponents[:, None] / 2 * np.log1p((k / corners[:, None]) ** 2)
    window = min(2 * REACH + 1, len(power))
    first = np.clip(bins - REACH, 0, len(power) - window)

    def around(values: Array) -> Array:
        sums = np.cumsum(np.pad(values, ((0, 0), (1, 0))), axis=1)
        return sums[:, first + window] - sums[:, first]

    here = log_shape[:, bins]
    freedom = around(left[None])
    log_determinant = around(left * log_shape) - freedom * here
    chi2 = around(power / white * np.exp(-log_shape)) * np.exp(here)
    levels = LEVELS[:, None, None]
    log_posterior = -(log_determinant + freedom * np.log(levels) + chi2 / levels) / 2
    log_posterior += np.log((1 - WHITE_PROBABILITY) / len(LEVELS) * _prior(exponents))[:, None]
    log_white = -around(power[None] / white)[0] / 2 + np.log(WHITE_PROBABILITY)
    largest = np.maximum(log_posterior.max(axis=(0, 1)), log_white)
    probability = np.exp(log_posterior - largest).sum(axis=1)
    probability[0] += np.exp(log_white - largest)
    density: Array = white * (_interval(probability / probability.sum(axis=0)) / NORMAL_975) ** 2
    return np.maximum(density, 1.0)


def _shapes() -> tuple[Array, Array]:
    """Return exponents and corner frequencies of the shapes, in steps of the cosine transform, each (m,)."""
    corners = np.geomspace(1 / (np.pi * LONGEST_MEMORY), 2 * REACH, N_CORNERS)
    exponents = np.repeat(EXPONENTS, N_CORNERS)
    return np.append(0.0, exponents), np.append(1.0, np.tile(corners, len(EXPONENTS)))


def _prior(exponents: Array) -> Array:
    """Return the probabilities of shapes: each exponent is equally likely, and so is each of its corners."""
    counts = np.array([np.count_nonzero(exponents == each) for each in exponents])
    return 1 / (counts * (1 + len(EXPONENTS)))


def _interval(probability: Array) -> Array:
    """Return half the 95 % interval of mixtures of normal distributions with the variances LEVELS (levels, m), shape (m,)."""
    sigma = np.sqrt(LEVELS)[:, None]
    low, high = np.zeros(probability.shape[1]), np.full(probability.shape[1], 2 * NORMAL_975 * sigma[-1, 0])
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_too_small = ((2 * ndtr(middle / sigma) - 1) * probability).sum(axis=0) < 0.95
        low, high = np.where(is_too_small, middle, low), np.where(is_too_small, high, middle)
    return high


def intervals(
    setting: FitContext, fit: Fit, values: EffectValues, companions: Iterable[str], noise_inflation: float
) -> tuple[Array, Array]:
    """Return how far the 95 % interval of each value reaches below and above it, (values,) each: 0 of what was not fitted.

    `values` are those of the fitted set. Each companion is linearised beside it.
    """
    sigma = standard_uncertainties(fit, setting.log)
    below, above = NORMAL_975 * sigma, NORMAL_975 * sigma
    tried = [name for name in companions if name not in values and name not in setting.model_effects]
    if not tried:
        return below, above
    simulator, at = setting.at_rest_beside(fit, values, tried)
    fitted = setting.simulator(tuple(values))
    flat = sensitivities_sigma(simulator, at, setting.log).reshape(-1, len(simulator.parameters))
    place_of = {spec.label: i for i, spec in enumerate(simulator.parameters)}
    free = np.flatnonzero(fit.free & (np.arange(len(fit.free)) != HEADING))
    columns = flat[:, [place_of[fitted.parameters[i].label] for i in free]]
    scale = np.linalg.norm(columns, axis=0)
    basis, triangle = np.linalg.qr(columns / np.where(scale > 0, scale, 1.0))
    residual = setting.log.residual_sigma(fit.force_g).ravel()
    has_loss = any(EFFECTS[name].dissipative for name in values)
    for name in tried:
        own = [i for i, spec in enumerate(simulator.parameters) if spec.effect == name and not spec.refitted]
        inside = basis.T @ flat[:, own]
        beyond = flat[:, own] - basis @ inside
        inverse = np.asarray(np.linalg.pinv(beyond.T @ beyond), dtype=np.float64)
        size, covariance = inverse @ (beyond.T @ residual), noise_inflation * inverse
        specs = [simulator.parameters[i] for i in own]
        is_one_sided = len(own) == 1 and specs[0].lower == specs[0].neutral
        gain = 0.0 if is_one_sided and size[0] < 0 else float(size @ beyond.T @ residual) / noise_inflation
        log_odds = 0.0 if has_loss and EFFECTS[name].dissipative else (gain - len(own) * math.log(len(residual))) / 2
        moved = -np.linalg.lstsq(triangle, inside, rcond=None)[0] / np.where(scale > 0, scale, 1.0)[:, None]
        for place, by in zip(free, moved, strict=True):
            shifts = _quantiles(by, size, covariance, is_one_sided)
            low, high = mixture_interval(shifts, sigma[place], math.exp(min(log_odds, 0.0)))
            below[place], above[place] = max(below[place], -low), max(above[place], high)
    return below, above


def _quantiles(by: Array, size: Array, covariance: Array, is_one_sided: bool) -> Array:
    """Return equally likely changes of a value by a companion of a size (k,) with this covariance, shape (N_QUANTILES,)."""
    probability = (np.arange(N_QUANTILES) + 0.5) / N_QUANTILES
    if not is_one_sided:
        quantiles: Array = by @ size + math.sqrt(max(float(by @ covariance @ by), 0.0)) * ndtri(probability)
        return quantiles
    sigma = math.sqrt(max(covariance[0, 0], np.finfo(np.float64).tiny))
    # Of the normal distribution above zero, from its upper end, where its probability keeps its digits.
    sizes = size[0] - sigma * ndtri(probability * ndtr(size[0] / sigma))
    one_sided: Array = by[0] * sizes
    return one_sided


def mixture_interval(shifts: Array, sigma: float, odds: float) -> tuple[float, float]:
    """Return the 95 % interval of a value about that of the set: without the companion, or by these odds moved by it."""
    if sigma == 0:
        return 0.0, 0.0

    def probability_below(x: float) -> float:
        return float(ndtr(x / sigma) + odds * ndtr((x - shifts) / sigma).mean()) / (1 + odds)

    reach = float(np.abs(shifts).max()) + 4 * sigma  # beyond it is less than the ends of an interval leave out
    low, high = (float(brentq(lambda x, p=p: probability_below(x) - p, -reach, reach)) for p in (0.025, 0.975))
    return low, high
