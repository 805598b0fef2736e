"""Trend: a straight line through values over time, with intervals that hold for few values as well.

The model is value = level + rate * time + random walk + error. The error has the standard uncertainty of each value; the
variance of the random walk grows by `random_walk` squared each day. The fit is a generalised least squares, a prediction its
conditional mean.
"""

import math
from dataclasses import dataclass

import numpy as np

from gateway.calibration.record import CalibrationError
from gateway.numerics.array import Array
from gateway.numerics.stats import CHANCE_LEVEL, NORMAL_975, chi_square_quantile, student_quantile

HORIZON_DAYS = 3650.0
"""Longest forecast, days. Basis: a choice; ten years, longer than a housing stays in service unchecked."""
FORECAST_STEPS = 200
"""Number of steps of a forecast, in geometric progression. Basis: a choice; each step is 6 % longer than the last, less than any
forecast is certain."""
WALK_VARIANCE_RATIOS = np.concatenate([[0.0], np.geomspace(1e-2, 1e4, 15)])
"""Candidates for the variance of the random walk over the whole span, relative to that of one value. Basis: a choice; from a walk
that is hidden in the values to one that hides them, in steps by a factor of 2.7."""
MIN_EVIDENCE = 0.1
"""Gain of log-likelihood at which a random walk is assumed. Basis: the intervals of straight lines then cover in 96 % of all
cases."""
MIN_CHI_SQUARE = 1e-300
"""Least chi-square whose logarithm is taken. Definition: a logarithm must be finite."""


@dataclass(frozen=True, slots=True)
class Trend:
    """A fitted line."""

    rate: float
    """Change per day."""
    rate_low: float
    """Lower end of the 95 % interval of the rate."""
    rate_high: float
    """Upper end of the 95 % interval of the rate."""
    random_walk: float
    """Standard deviation of the random walk per square root of a day, given or estimated."""
    is_rejected: bool
    """Whether the values scatter about a straight line by more than their uncertainties allow: there is no steady trend."""
    _fit: "_WeightedFit"
    _k_coverage: float

    def predict(self, day: Array) -> tuple[Array, Array]:
        """Return the true values expected on later days, and half of their 95 % intervals, each of shape (m,)."""
        mean, variance = self._fit.predict(day)
        return mean, self._k_coverage * np.sqrt(variance)


@dataclass(frozen=True, slots=True)
class _WeightedFit:
    """Generalised least squares with one covariance of the values."""

    day: Array
    design: Array
    walk_variance: float
    """Variance of the random walk per day."""
    coefficients: Array
    covariance: Array
    residual: Array
    chi_square: float
    cholesky: Array
    """Lower triangular factor of the covariance of all values."""
    log_determinants: float
    """Restricted log-likelihood without the scale: minus the logarithms of the determinants' roots."""

    @property
    def restricted_log_likelihood(self) -> float:
        return self.log_determinants - self.chi_square / 2

    def predict(self, day: Array) -> tuple[Array, Array]:
        """Return values and variances on later days, (m,) each; a covariate is at its mean."""
        rows = np.zeros((len(day), self.design.shape[1]))
        rows[:, 0], rows[:, 1] = 1.0, day
        shared = self.walk_variance * np.minimum.outer(self.day, day) - self.walk_variance * self.day[0]
        weights = np.linalg.solve(self.cholesky.T, np.linalg.solve(self.cholesky, shared))
        remainder = rows - weights.T @ self.design
        own = self.walk_variance * (day - self.day[0]) - (shared * weights).sum(axis=0)
        variance = own + ((remainder @ self.covariance) * remainder).sum(axis=1)
        return rows @ self.coefficients + weights.T @ self.residual, np.maximum(variance, 0.0)


def fit_measurements(day: Array, value: Array, u_value: Array, random_walk: float | None = None) -> Trend:
    """Fit a trend to measurements with known standard uncertainties, shape (n,) each, n >= 2, days rising.

    If the random walk is not given, the most likely one is estimated; if there is any, the interval uses Student's t. Raises
    `CalibrationError` for fewer than two values or uncertainties of zero.
    """
    _check_measurements(day, u_value)
    freedom = len(day) - 2
    design, errors = _design_matrix(day), np.diag(u_value**2)
    straight = _fit(day, value, errors, 0.0, design)
    fit, quantile = straight, NORMAL_975
    if random_walk is not None:
        fit = _fit(day, value, errors, random_walk**2, design)
    elif freedom > 0:
        per_day = float(np.mean(u_value**2)) / float(day[-1] - day[0])
        fits = [_fit(day, value, errors, ratio * per_day, design) for ratio in WALK_VARIANCE_RATIOS]
        fit = max(fits, key=lambda one: one.restricted_log_likelihood)
        if fit.restricted_log_likelihood - straight.restricted_log_likelihood > MIN_EVIDENCE:
            quantile = student_quantile(0.975, freedom)
        else:
            fit = straight
    return _trend(
        fit,
        k_coverage=quantile,
        random_walk=fit.walk_variance**0.5,
        is_rejected=freedom > 0 and straight.chi_square > chi_square_quantile(CHANCE_LEVEL, freedom),
    )


def fit_means(day: Array, value: Array, covariate: Array | None = None) -> Trend:
    """Fit a trend to many similar means of unknown scatter, shape (n,), n >= 4; scatter and random walk are estimated.

    A `covariate`, such as the temperature, is fitted together with time. Raises `CalibrationError` for too few values.
    """
    design = _design_matrix(day, covariate)
    freedom = len(day) - int(design.shape[1])
    if freedom < 1:
        raise CalibrationError(f"a trend of means needs at least {design.shape[1] + 1} of them; there are {len(day)}")
    span_days = float(day[-1] - day[0])
    fits = [_fit(day, value, np.eye(len(day)), ratio / span_days, design) for ratio in WALK_VARIANCE_RATIOS]

    def profile_log_likelihood(fit: _WeightedFit) -> float:
        return fit.log_determinants - freedom / 2 * math.log(max(fit.chi_square, MIN_CHI_SQUARE))

    best = max(fits, key=profile_log_likelihood)
    scatter = float(np.sqrt(best.chi_square / freedom))
    return _trend(
        best,
        k_coverage=scatter * student_quantile(0.975, freedom),
        random_walk=scatter * best.walk_variance**0.5,
        is_rejected=False,
    )


def _trend(fit: _WeightedFit, *, k_coverage: float, random_walk: float, is_rejected: bool) -> Trend:
    rate, half = float(fit.coefficients[1]), k_coverage * float(np.sqrt(fit.covariance[1, 1]))
    return Trend(rate, rate - half, rate + half, random_walk, is_rejected, fit, k_coverage)


def _design_matrix(day: Array, covariate: Array | None = None) -> Array:
    columns = [np.ones(len(day)), day] + ([] if covariate is None else [covariate - covariate.mean()])
    return np.stack(columns, axis=1)


def _fit(day: Array, value: Array, error_covariance: Array, walk_variance: float, design: Array) -> _WeightedFit:
    """Fit by orthogonal decomposition, because uncertainties may differ by many orders of magnitude."""
    total = error_covariance + walk_variance * np.minimum.outer(day - day[0], day - day[0])
    try:
        cholesky = np.linalg.cholesky(total)
        white = np.linalg.solve(cholesky, np.column_stack([design, value]))
        orthogonal, upper = np.linalg.qr(white[:, :-1])
        inverse_upper = np.linalg.inv(upper)
    except np.linalg.LinAlgError as error:
        raise CalibrationError(
            "the uncertainties differ too much for a trend; leave the coarse calibration out"
        ) from error
    coefficients = inverse_upper @ orthogonal.T @ white[:, -1]
    white_residual = white[:, -1] - white[:, :-1] @ coefficients
    log_determinants = np.log(np.diag(cholesky)).sum() + np.log(np.abs(np.diag(upper))).sum()
    return _WeightedFit(
        day=day,
        design=design,
        walk_variance=walk_variance,
        coefficients=coefficients,
        covariance=inverse_upper @ inverse_upper.T,
        residual=value - design @ coefficients,
        chi_square=float(white_residual @ white_residual),
        cholesky=cholesky,
        log_determinants=-float(log_determinants),
    )


def _check_measurements(day: Array, u_value: Array) -> None:
    if len(day) < 2:
        raise CalibrationError("a drift needs two calibrations at least; keep the earlier record and calibrate again")
    if np.any(np.diff(day) <= 0):
        raise CalibrationError("the calibrations are not at rising times; give each once, oldest first")
    if np.any(u_value <= 0):
        raise CalibrationError(
            "a calibration states no uncertainty (covariance of zero); a drift cannot be judged by it"
        )
