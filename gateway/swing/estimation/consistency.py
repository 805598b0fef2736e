"""Other fits that explain a recording almost as well: other swings near the load, and segments with other sensor errors.

Near the load, readings across the rope are a small part (1 - rho) of the swing. Where it is not known whether the sensor is above
or below the centre of the swing (rho below or above 1), a swing of opposite phase explains the readings almost as well, with
other errors of the sensor. A circular swing has only the mean of the axial force to show its size, so a wider one on a shorter
rope does as well where the sensor's scale is not known.

Segments: one sensor measured the whole recording, so the segments must agree on its errors. A short segment separates the
lean from a zero-g offset only weakly, and wrongly where the rope moves unnoticed in it; lean, offset and angle are then wrong
together. The lean itself may change from segment to segment, as a side pull does, and is not constrained. The sensor's errors
do not change.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.estimation.hoist_tracking import FittedInterval
from gateway.swing.estimation.robust_fit import (
    RESIDUAL_OUTLIER_SIGMA,
    FitResult,
    fit_robust,
    inflate_uncertainty,
)
from gateway.swing.fit.priors import N_SENSOR_ERRORS, Prior, SensorModel
from gateway.swing.model.motion import PendulumMotion
from gateway.swing.model.spherical_pendulum import equilibrium
from gateway.swing.uncertainty.peaks import largest_angle, largest_angle_gradient

MAX_DIFFERENCE_SIGMA = 1.5
"""Standard deviations by which two may differ."""


@dataclass(frozen=True, slots=True)
class SegmentEstimate:
    """What a segment contributes on the unknown errors of sensor and housing, in standard deviations of their prior."""

    errors: Array
    information: Array
    """Information on the errors beyond the prior, shape (free, free)."""
    angle_rad: float
    """The segment's largest angle."""
    u_rad: float
    angle_by_errors: Array
    """Change of the angle when the errors are known to be others."""


def enforce_common_sensor_errors(segments: list[FittedInterval]) -> tuple[list[FittedInterval], tuple[str, ...]]:
    """Return the segments with the disagreement on the sensor's errors in their uncertainty, and a reason where there is any.

    Where a segment's angle would be another with the sensor errors of the other segments, the part of the difference that chance
    does not explain is added to its uncertainty.
    """
    if len(segments) < 2 or not _free_errors(segments[0].result).any():
        return segments, ()
    estimates = [_estimate_errors(segment.result) for segment in segments]
    found, inconsistent = [], []
    for place, (segment, estimate) in enumerate(zip(segments, estimates, strict=True)):
        excess_rad = _excess_difference_rad(estimate, estimates[:place] + estimates[place + 1 :])
        found.append(replace(segment, result=inflate_uncertainty(segment.result, excess_rad / estimate.angle_rad)))
        if excess_rad > estimate.u_rad:
            inconsistent.append(f"{segment.from_s:.0f}-{segment.to_s:.0f} s")
    if not inconsistent:
        return found, ()
    return found, (f"wider interval: {', '.join(inconsistent)} alone would show other sensor errors than the rest",)


def _excess_difference_rad(one: SegmentEstimate, others: list[SegmentEstimate]) -> float:
    """Return the change of an angle under the sensor errors of the others, less what chance explains."""
    prior = np.eye(len(one.errors))
    covariance = np.linalg.inv(prior + sum(other.information for other in others))
    errors = covariance @ sum((prior + other.information) @ other.errors for other in others)
    own = np.linalg.inv(prior + one.information)
    difference = own + covariance - own @ covariance - covariance @ own  # of two estimates with the same prior
    change_rad = float(one.angle_by_errors @ (errors - one.errors))
    variance_rad2 = float(one.angle_by_errors @ difference @ one.angle_by_errors)
    return float(np.sqrt(max(change_rad**2 - MAX_DIFFERENCE_SIGMA**2 * variance_rad2, 0.0)))


def _estimate_errors(result: FitResult) -> SegmentEstimate:
    fit, free = result.fit, _free_errors(result)
    count, sigma = int(free.sum()), fit.prior.sigma[-N_SENSOR_ERRORS:][free]
    covariance = result.uncertainty.covariance[:, -count:] / sigma
    own = covariance[-count:] / sigma[:, None]
    values, vectors = np.linalg.eigh(np.linalg.inv((own + own.T) / 2) - np.eye(count))
    angle_rad, u_rad = largest_angle(fit, result.uncertainty)
    return SegmentEstimate(
        errors=fit.sensor.errors[free] / sigma,
        information=(vectors * np.maximum(values, 0.0)) @ vectors.T,
        angle_rad=max(angle_rad, 1e-6),
        u_rad=u_rad,
        angle_by_errors=np.asarray(np.linalg.solve(own, largest_angle_gradient(fit) @ covariance), dtype=np.float64),
    )


def _free_errors(result: FitResult) -> NDArray[np.bool_]:
    """Return which errors of sensor and housing are unknown."""
    return result.fit.free[-N_SENSOR_ERRORS:]


MAX_DISTANCE_SIGMA = 3.0
"""Standard uncertainties of the position between the sensor and the load, up to which the phase is not known."""
DECISIVE_CHI2 = 9.0
"""Difference of chi-square, over the reduced one where that exceeds 1, from which on the less likely fit is left out."""


def choose_mode(
    result: FitResult | None,
    guesses: list[PendulumMotion],
    bins: Bins,
    noise_g: Array,
    prior: Prior,
    iterations: int,
) -> FitResult | None:
    """Return the most likely one of a fit, those from guesses and that of opposite phase; the fit itself where none is valid.

    Its rivals are all others that the readings do not tell from it, those that converge slowly included.
    """

    def fit(starts: list[tuple[PendulumMotion, SensorModel]]) -> list[FitResult]:
        found = [fit_robust(bins, noise_g, motion, prior, iterations, sensor) for motion, sensor in starts]
        return [each for each in found if each is not None and each.uncertainty.is_adequate]

    starts = [(guess.with_parameters(prior.n_parameters), SensorModel.ideal()) for guess in guesses]
    fits = fit(starts) + ([] if result is None else [result])
    if fits:
        fits += fit(_opposite_phase(min(fits, key=_cost)))
        best = min(fits, key=_cost)
        fits += [] if best.fit.converged else fit([(best.fit.motion, best.fit.sensor)])
    valid = [each for each in fits if each.is_valid]
    if not valid:
        return result
    best = min(valid, key=_cost)
    highest = _cost(best) + DECISIVE_CHI2 * max(best.uncertainty.reduced_chi_square, 1.0)
    return replace(best, rivals=tuple(each for each in fits if each is not best and _cost(each) < highest))


def _opposite_phase(result: FitResult) -> list[tuple[PendulumMotion, SensorModel]]:
    """Return the start of a fit of opposite phase; none where the sensor is known to be above the load."""
    fit = result.fit
    distance_m = fit.motion.length_m - fit.prior.rig.position_at(fit.motion.length_m) - fit.sensor.position_error_m
    if abs(distance_m) > MAX_DISTANCE_SIGMA * float(fit.prior.sigma[-N_SENSOR_ERRORS]):
        return []
    q, w, pull = fit.motion.nodes
    motion = replace(fit.motion, nodes=np.stack([2 * equilibrium(pull) - q, -w, pull]))
    errors = np.zeros_like(fit.sensor.errors)
    errors[0] = fit.sensor.position_error_m + 2 * distance_m
    return [(motion, SensorModel(errors))]


def _cost(result: FitResult) -> float:
    """Return chi-square by sensor noise, with that of the prior and with that at which a reading counts as an outlier."""
    fit = result.fit
    of_prior = fit.prior.information @ ((fit.unknowns - fit.prior.mean)[fit.free] ** 2)
    of_data = result.uncertainty.reduced_chi_square * fit.weight.size
    return of_data + float(of_prior) + result.outliers * RESIDUAL_OUTLIER_SIGMA**2
