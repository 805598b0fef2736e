"""Robust fits of a window: outliers removed, disturbed axes weighted down, and the prior relaxed where the data demand it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.numerics.stats import robust_sigma
from gateway.swing.data.bins import Bins
from gateway.swing.fit.gauss_newton import SwingFit, iterate, linearise, maximum_a_posteriori, reweight
from gateway.swing.fit.priors import Prior, SensorModel
from gateway.swing.model.motion import DRAG, FRICTION, N_BASE_PARAMETERS, N_STATES, PendulumMotion
from gateway.swing.uncertainty.peaks import largest_angle
from gateway.swing.uncertainty.uncertainty_model import (
    MAX_MISFIT,
    UncertaintyModel,
    misfit,
    uncertainty_of,
    variance_inflation,
)

RESIDUAL_OUTLIER_SIGMA = 6.0
MAX_OUTLIER_SHARE = 0.03
"""Share of the bins; more than that are not spikes but something that the pendulum does not know."""
MIN_REWEIGHT_INFLATION = 1.5
"""Inflation of an axis' variance from which on it is weighted down."""
HOPELESS_MISFIT_RATIO = 3.0
"""Times the largest misfit, from which on other weights or more iterations do not mend a fit."""
HOPELESS_COST_RATIO = 10.0
"""Times the chi-square of another start's fit, from which on a fit that hardly improves is given up."""
NEGLIGIBLE_MISFIT = 0.003
"""Unexplained part of the signal up to which the rig as stated is not doubted: it costs more than it mends."""
GOOD_REDUCED_CHI_SQUARE = 1.3
"""Reduced chi-square at which no other start is tried."""
SIGNIFICANT_SIGMA = 3.0
"""Standard uncertainties that an error must have to be named."""
DAMPING_GAIN = 2.0
"""Fall of chi-square from which on drag and friction are kept. Basis: Akaike's criterion for two unknowns, each of which is at
least zero."""
MAX_NAMED_ERRORS = 4
MAX_PRIOR_SIGMA = 4.0
"""Prior standard deviations beyond which an error of the rig is no explanation."""
MAX_BELOW_SHARE = 0.05
"""Distance of the housing below the load, over the rope's length, beyond which a place is no explanation. Basis: a choice; a load
is held by its hook, and a housing on the hook hangs no further below its centre."""
REFIT_ITERATIONS = 12
MIN_FITTED_BINS = 8
"""Fewest bins of a fit: a piece of a recording may lie in a gap. Basis: 24 readings determine the eight unknowns of a swing and
leave a residual."""


@dataclass(frozen=True, slots=True)
class FitResult:
    """A fit with its uncertainty, and what was changed to obtain it."""

    fit: SwingFit
    uncertainty: UncertaintyModel
    noise_ratio: float = 1.0
    """Factor by which the noise would have to be larger to explain the residual."""
    outliers: int = 0
    """Bins that were left out."""
    sensor_errors: tuple[str, ...] = ()
    """Errors of rig or sensor that the data demand, in words."""
    rivals: tuple["FitResult", ...] = ()
    """Other swings that the readings do not tell from this one."""

    @property
    def is_valid(self) -> bool:
        """The fit converged and the pendulum describes the data: an uncertainty can be stated."""
        return self.fit.converged and self.uncertainty.is_adequate

    @property
    def is_explained(self) -> bool:
        """Noise explains the residual, or all of it that matters."""
        return self.fit.converged and self.uncertainty.misfit < NEGLIGIBLE_MISFIT


def fit_robust(
    bins: Bins,
    noise_g: Array,
    motion: PendulumMotion,
    prior: Prior,
    iterations: int,
    sensor: SensorModel | None = None,
    *,
    max_misfit: float = MAX_MISFIT,
) -> FitResult | None:
    """Return the fit of a window; None when the motion leaves the model, or for too few readings.

    `max_misfit`: unexplained part of the signal up to which the caller can use the fit; a fit that stays far above is given up.
    """
    if len(bins) < MIN_FITTED_BINS:
        return None
    weight = bins.count[:, None] / noise_g**2
    fit = linearise(bins, weight, motion, prior, sensor)
    return None if fit is None else _refined(_iterated(fit, iterations, weight, max_misfit), weight)


def fit_robust_from(
    bins: Bins,
    noise_g: Array,
    guesses: list[PendulumMotion],
    prior: Prior,
    iterations: int,
    *,
    max_misfit: float = MAX_MISFIT,
) -> FitResult | None:
    """Return the fit from the best of several guesses, the nearest to the data first; the first that noise explains ends it.

    None where no guess stays in the model, or for too few readings.
    """
    if len(bins) < MIN_FITTED_BINS:
        return None
    weight = bins.count[:, None] / noise_g**2
    motions = [guess.with_parameters(prior.n_parameters) for guess in guesses]
    fits = [fit for motion in motions if (fit := linearise(bins, weight, motion, prior)) is not None]
    near = HOPELESS_COST_RATIO * min((fit.cost for fit in fits), default=0.0)
    best: SwingFit | None = None
    for fit in sorted((fit for fit in fits if fit.cost <= near), key=lambda fit: fit.cost) if len(fits) > 1 else []:
        trial = iterate(fit, max(iterations // 2, 1), _hopeless(weight, max_misfit, best))
        best = trial if best is None or trial.cost < best.cost else best
        if best.cost < GOOD_REDUCED_CHI_SQUARE * weight.size:
            break
    best = best or next(iter(fits), None)
    if best is None:
        return None
    return _refined(best if best.converged else _iterated(best, iterations, weight, max_misfit), weight)


def _iterated(start: SwingFit, iterations: int, weight: Array, max_misfit: float) -> SwingFit:
    """Return the fit after some iterations, if need be with weights that contain what the pendulum leaves unexplained.

    Where that is far above the noise, priors count for nothing against it: unknowns that the data hardly determine run away, and
    the fit does not converge.
    """
    fit = iterate(start, iterations, _hopeless(weight, max_misfit))
    if fit.converged or misfit(fit, weight) > HOPELESS_MISFIT_RATIO * max_misfit:
        return fit
    inflation = uncertainty_of(fit, weight).variance_inflation
    reweighted = iterate(reweight(start, weight / inflation), iterations)
    return reweighted if reweighted.converged else fit


def _hopeless(weight: Array, max_misfit: float, rival: SwingFit | None = None) -> Callable[[SwingFit], bool]:
    """Return a test of a fit that hardly improves any more: far from being of use, or from the best so far."""

    def should_abandon(fit: SwingFit) -> bool:
        outdone = rival is not None and fit.cost > HOPELESS_COST_RATIO * rival.cost
        return outdone or misfit(fit, weight) > HOPELESS_MISFIT_RATIO * max_misfit

    return should_abandon


def _refined(fit: SwingFit, weight: Array) -> FitResult | None:
    """Return the fit without outliers and with disturbed axes weighted down; `weight` is by sensor noise alone."""
    fit = _without_driving(fit)
    outliers = _outliers(fit) & fit.converged
    if outliers.any():
        bins, weight, used = fit.bins.select(~outliers), weight[~outliers], fit.weight[~outliers]
        without = maximum_a_posteriori(bins, used, fit.motion, fit.prior, REFIT_ITERATIONS, fit.sensor)
        if without is None:
            return None
        fit = without
    uncertainty = uncertainty_of(fit, weight)
    inflation = uncertainty.variance_inflation
    correctable = uncertainty.misfit < HOPELESS_MISFIT_RATIO * MAX_MISFIT
    if inflation.max() > MIN_REWEIGHT_INFLATION and fit.converged and correctable:
        fit = iterate(reweight(fit, fit.weight / inflation), REFIT_ITERATIONS)
        uncertainty = uncertainty_of(fit, weight)
    noise_ratio = float(np.sqrt(variance_inflation(fit, weight)[0].max()))
    return FitResult(fit, uncertainty, noise_ratio, int(outliers.sum()))


def _without_driving(fit: SwingFit) -> SwingFit:
    """Return the fit without damping, drag and friction that would drive the swing: the negative ones are zero."""
    count = len(fit.motion.parameters)
    if fit.motion.splines is not None or count == N_BASE_PARAMETERS or not fit.converged:
        return fit
    negative = [place for place in (DRAG, FRICTION) if fit.motion.parameters[place] < 0]
    if not negative:
        return fit
    parameters, sigma = fit.motion.parameters.copy(), fit.prior.sigma.copy()
    parameters[negative] = 0.0
    sigma[[N_STATES + place for place in negative]] = 0.0
    motion, prior = replace(fit.motion, parameters=parameters), replace(fit.prior, sigma=sigma)
    bounded = maximum_a_posteriori(fit.bins, fit.weight, motion, prior, REFIT_ITERATIONS, fit.sensor)
    return fit if bounded is None else _without_driving(bounded)


def choose_prior(nominal: FitResult | None, relaxed: FitResult | None) -> FitResult | None:
    """Return the fit to use of one with the rig as stated and one with the relaxed prior."""
    if relaxed is None or not relaxed.is_valid or not _has_plausible_errors(relaxed.fit):
        return nominal
    if nominal is not None and nominal.is_valid and _angle_u_rad(nominal) < _angle_u_rad(relaxed):
        return _inflated_by_difference(nominal, relaxed)
    return replace(relaxed, sensor_errors=_significant_errors(relaxed))


def _inflated_by_difference(nominal: FitResult, relaxed: FitResult) -> FitResult:
    """Return the fit with the rig as stated; the difference to the other one's angle is part of its uncertainty."""
    angle_rad, other_rad = (largest_angle(each.fit, each.uncertainty)[0] for each in (nominal, relaxed))
    return inflate_uncertainty(nominal, abs(other_rad / angle_rad - 1))


def inflate_uncertainty(result: FitResult, angle_u_rel: float) -> FitResult:
    """Return the fit with a further relative uncertainty of its angles."""
    u_rel = float(np.hypot(result.uncertainty.systematic_u_rel, angle_u_rel))
    return replace(result, uncertainty=replace(result.uncertainty, systematic_u_rel=u_rel))


def choose_damping(viscous: FitResult | None, damped: FitResult | None) -> FitResult | None:
    """Return the fit with drag and friction where the decay shows them, or else the one with viscous damping alone."""
    if viscous is None or damped is None or not (viscous.is_valid and damped.is_valid):
        return choose_fit(viscous, damped)
    before, after = (each.uncertainty.reduced_chi_square for each in (viscous, damped))
    gain = (before - after) / max(after, 1.0) * damped.fit.weight.size
    return replace(damped, rivals=viscous.rivals) if gain > DAMPING_GAIN else viscous


def choose_fit(first: FitResult | None, second: FitResult | None) -> FitResult | None:
    """Return the better one of two fits with the same prior: converged, and with less of the signal unexplained."""
    if second is None or not second.fit.converged:
        return first
    if first is None or not first.fit.converged or second.uncertainty.misfit < first.uncertainty.misfit:
        return second
    return first


def _outliers(fit: SwingFit) -> NDArray[np.bool_]:
    """Return which bins are few, lone and far from all others, shape (bins,)."""
    size = np.abs(fit.residual_g) * np.sqrt(fit.weight)
    usual = np.maximum(robust_sigma(size), 1.0)
    far: NDArray[np.bool_] = np.any(size > RESIDUAL_OUTLIER_SIGMA * usual, axis=1)
    few = np.count_nonzero(far) <= max(MAX_OUTLIER_SHARE * len(size), 1)
    return far & few


def _angle_u_rad(result: FitResult) -> float:
    """Return the standard uncertainty of the largest angle."""
    return largest_angle(result.fit, result.uncertainty)[1]


def _has_plausible_errors(fit: SwingFit) -> bool:
    """Return whether no error of the sensor is far outside its prior, and the housing not below the load."""
    first = N_STATES + len(fit.motion.parameters)
    deviation, sigma = fit.sensor.errors - fit.prior.mean[first:], fit.prior.sigma[first:]
    length_m = fit.motion.length_m
    position_m = fit.prior.rig.position_at(length_m) + fit.sensor.position_error_m
    is_below = position_m > (1 + MAX_BELOW_SHARE) * length_m
    return not is_below and bool((np.abs(deviation) <= MAX_PRIOR_SIGMA * sigma)[sigma > 0].all())


def _significant_errors(result: FitResult) -> tuple[str, ...]:
    """Return in words the errors of rig and sensor that the data demand, the most significant first."""
    fit, first = result.fit, N_STATES + N_BASE_PARAMETERS
    errors = (fit.unknowns - fit.prior.mean)[first:]
    sigma = np.full(len(fit.free), np.inf)
    sigma[fit.free] = np.sqrt(np.diag(result.uncertainty.covariance))
    ratio = np.abs(errors) / sigma[first:]
    order = np.argsort(-ratio)[:MAX_NAMED_ERRORS]
    named = tuple(_in_words(errors)[i] for i in order if ratio[i] > SIGNIFICANT_SIGMA)
    return named or ("several small errors together",)


def _in_words(errors: Array) -> list[str]:
    """Return drag, spin, friction, place, mount, offsets and matrix in words."""
    drag, spin_1_s, friction_rad, position_m, x_m, y_m, about_x_rad, about_y_rad, *rest = errors
    offsets = [f"{axis} zero-g offset {1e3 * g:+.1f} mg" for axis, g in zip("xyz", rest[:3], strict=True)]
    entries = [(row, column) for row in "xyz" for column in "xyz"]
    matrix = [
        f"{f'scale of {row}' if row == column else f'{column} into {row}'} {100 * error:+.2f} %"
        for (row, column), error in zip(entries, rest[3:], strict=True)
    ]
    return [
        f"quadratic drag {drag:+.3f}",
        f"housing turning {np.degrees(spin_1_s):+.2f} deg/s",
        f"dry friction {np.degrees(friction_rad):+.2f} deg",
        f"housing {position_m:+.2f} m along the rope",
        *(f"sensor {m:+.3f} m beside the rope in {axis}" for axis, m in (("x", x_m), ("y", y_m))),
        *(f"mount {np.degrees(rad):+.1f} deg about {axis}" for axis, rad in (("x", about_x_rad), ("y", about_y_rad))),
        *offsets,
        *matrix,
    ]
