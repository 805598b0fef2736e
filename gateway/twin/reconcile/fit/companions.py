"""Intervals of fitted values that allow for a companion: an effect that acts as well and is too small to be named.

A set without the companion gives its part to the values of others: drag alone takes the damping for drag. So the interval is that
of the average over the set and the set with the companion, by their evidence (Hoeting et al. 1999), and of all these the widest.
The named set counts no less than any other. A loss beside a loss counts as much: every rig has each to some degree.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.fit.coloured_covariance import standard_uncertainties
from gateway.twin.reconcile.fit.fit_context import FitContext, sensitivities_sigma
from gateway.twin.reconcile.fit.least_squares import Fit
from gateway.twin.simulator.state import HEADING

Array = NDArray[np.float64]
N_QUANTILES = 64
"""Equally likely sizes of a companion that stand for their distribution; the ends of an interval are true to 1 % of it."""


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
    simulator = setting.simulator((*values, *tried))
    fitted = setting.simulator(tuple(values))
    at = simulator.values(fit.values[: simulator.n_initial_states], fitted.effects(fit.values))
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
