"""The same swing half a period later: near the load, readings across the rope do not show on which side the load is.

They are (1 - rho) times the swing. Where it is not known whether the sensor is above or below the centre of the swing (rho below
or above 1), a swing of opposite phase explains the readings almost as well, with other errors of the sensor.
"""

from dataclasses import replace

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.estimation.robust_fit import FitResult, fit_robust, inflate_uncertainty
from gateway.swing.fit.priors import N_SENSOR_ERRORS, SensorModel
from gateway.swing.model.spherical_pendulum import equilibrium
from gateway.swing.uncertainty.peaks import largest_angle

MAX_DISTANCE_SIGMA = 3.0
"""Standard uncertainties of the position between the sensor and the load, up to which the phase is not known."""
DECISIVE_CHI2 = 9.0
"""Difference of chi-square from which on the less likely phase is left out."""


def choose_phase(result: FitResult, bins: Bins, noise_g: Array, iterations: int) -> FitResult:
    """Return the fit of the more likely phase; an uncertainty that holds both where the readings do not tell them apart."""
    fit, rig = result.fit, result.fit.prior.rig
    length_m = fit.motion.length_m
    sensor_m = rig.position_at(length_m) + fit.sensor.position_error_m
    position_u_m = float(fit.prior.sigma[-N_SENSOR_ERRORS])
    if abs(length_m - sensor_m) > MAX_DISTANCE_SIGMA * position_u_m:
        return result
    q, w, pull = fit.motion.nodes
    motion = replace(fit.motion, nodes=np.stack([2 * equilibrium(pull) - q, -w, pull]))
    errors = np.zeros_like(fit.sensor.errors)
    errors[0] = fit.sensor.position_error_m + 2 * (length_m - sensor_m)
    other = fit_robust(bins, noise_g, motion, fit.prior, iterations, SensorModel(errors))
    if other is None or not other.fit.converged:
        return result
    before, after = _cost(result), _cost(other)
    best, second = (other, result) if after < before else (result, other)
    if abs(after - before) > DECISIVE_CHI2 or not second.is_valid:
        return best
    best_rad, second_rad = (largest_angle(each.fit, each.uncertainty)[0] for each in (best, second))
    return inflate_uncertainty(best, abs(second_rad / best_rad - 1))


def _cost(result: FitResult) -> float:
    """Return chi-square by sensor noise, with that of the prior."""
    fit = result.fit
    of_prior = fit.prior.information @ ((fit.unknowns - fit.prior.mean)[fit.free] ** 2)
    return result.uncertainty.reduced_chi_square * fit.weight.size + float(of_prior)
