"""From a fit to what may be claimed: covariance, inflation by what the pendulum does not explain, coverage intervals."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.autocorrelation import correlation_sum
from gateway.numerics.stats import student_quantile
from gateway.swing.fit.likelihood import Fit, information, weighted_square
from gateway.swing.model.motion import LN_LENGTH, STATES
from gateway.swing.model.sensor_lowpass import angle_u_rel
from gateway.swing.model.spherical_pendulum import Real

MISFIT_LEVERAGE = 3.0
"""Standard uncertainty of an angle, relative, per unexplained part of the signal.

Planted errors of position, offset, scale, axes, damping, wind, trolley and clock moved the angle by up to 5.3 times the
misfit that they left, mostly by less than 3: what is seen of an error in the residual is less than what went into the angle.
"""
LARGEST_MISFIT = 0.08
"""Unexplained part of the signal (rms over rms) beyond which the pendulum does not describe the data."""
CHANCE = 4.5
"""Standard deviations above the noise's own share from which on smoothed residuals count as misfit."""
SMOOTHING_BINS = 4
"""An eighth of a period: misfit is what is left in the swing's own band, not a vibration far above it."""


@dataclass(frozen=True, slots=True)
class UncertaintyModel:
    """Second moments of the unknowns and how far the model can be believed."""

    covariance: Real
    """Of the free unknowns, shape (free, free)."""
    freedom: float
    """Effective degrees of freedom of the residual."""
    reduced_chi_square: float
    inflation: Real
    """By which the noise's variance has to be multiplied, shape (3,): 1 where the residual is white and of the stated size."""
    misfit: float
    """Rms of the unexplained part in the swing's band over rms of the swing's signal; 0 where noise can make it."""
    other_u_rel: float = 0.0
    """Of an angle, by what the fit has no unknown for: the sensor's low-pass, a rig that may be another than stated."""

    @property
    def describes(self) -> bool:
        """The pendulum describes the data well enough for an uncertainty."""
        return self.misfit < LARGEST_MISFIT

    def angle_deviation(self, angle_rad: float, gradient: Real) -> float:
        """Standard uncertainty of an angle with this gradient by the free unknowns."""
        by_noise = max(float(gradient @ self.covariance @ gradient), 0.0)
        relative = np.hypot(MISFIT_LEVERAGE * self.misfit, self.other_u_rel)
        return float(np.sqrt(by_noise + (relative * angle_rad) ** 2))

    @property
    def length_deviation_rel(self) -> float:
        """Relative standard uncertainty of the rope's length."""
        place = STATES + LN_LENGTH
        return float(np.sqrt(max(self.covariance[place, place], 0.0)))

    @property
    def coverage_factor(self) -> float:
        """Student's t for 95 %, two-sided."""
        return student_quantile(0.975, max(self.freedom, 4.0))


def uncertainty_of(fit: Fit, sensor_weight: Real) -> UncertaintyModel:
    """What the fit supports; `sensor_weight` is 1/variance of the bins by sensor noise alone, shape (bins, 3).

    The residual's variance and its correlation over time (the sum of its autocorrelation) multiply the variance that sensor
    noise alone would give, axis by axis; never below the noise itself.
    """
    normalised = fit.residual_g * np.sqrt(fit.weight)
    chi_square = (normalised**2).mean(axis=0)
    correlation = np.array([correlation_sum(normalised[:, axis]) for axis in range(3)])
    inflation = np.maximum(chi_square * correlation, 1.0)
    bread = np.linalg.inv(information(fit))
    filling = weighted_square(fit.jacobian, fit.weight * inflation) + np.diag(fit.beliefs.information)
    unknowns = fit.jacobian.shape[-1]
    return UncertaintyModel(
        covariance=bread @ filling @ bread,
        freedom=max(float((len(normalised) / correlation).sum()) - unknowns, 1.0),
        reduced_chi_square=float((sensor_weight * fit.residual_g**2).sum()) / max(normalised.size - unknowns, 1),
        inflation=inflation,
        misfit=misfit(fit, sensor_weight),
        other_u_rel=angle_u_rel(fit.beliefs.rig.bandwidth_hz, fit.motion.period_s),
    )


def misfit(fit: Fit, weight: Real) -> float:
    """Unexplained over signal, all axes together; `weight` is 1/variance of the bins by sensor noise alone."""
    residual_g, variance_g2 = _smoothed(fit.residual_g, weight)
    noise_g2 = variance_g2.mean(axis=0)
    chance = 1 + CHANCE * np.sqrt(2 * SMOOTHING_BINS / max(len(fit.residual_g), 1))
    unexplained = (residual_g**2).mean(axis=0)
    seen = np.where(unexplained > chance * noise_g2, unexplained - noise_g2, 0.0)
    signal = fit.bins.force_g.var(axis=0) - (1 / weight).mean(axis=0)
    return float(np.sqrt(seen.sum() / max(float(np.maximum(signal, 0.0).sum()), 1e-14)))


def _smoothed(residual_g: Real, weight: Real) -> tuple[Real, Real]:
    """Weighted running means of the residual and their variances, each (bins - SMOOTHING_BINS + 1, 3)."""
    length = min(SMOOTHING_BINS, len(residual_g))
    zero = np.zeros((1, 3))
    sums = np.concatenate([zero, np.cumsum(weight * residual_g, axis=0)])
    weights = np.concatenate([zero, np.cumsum(weight, axis=0)])
    total = weights[length:] - weights[:-length]
    return (sums[length:] - sums[:-length]) / total, 1 / total
