"""A straight line through few or many values over time, with intervals that say how little few points show.

The model is value = level + rate * time + wander + error: the error with the standard uncertainty of each value, the wander a
random walk whose variance grows by `wander` squared each day. Generalised least squares; predictions by its conditional mean.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import CalibrationError
from gateway.numerics.stats import NORMAL_975, chi_square_quantile, student_quantile

Array = NDArray[np.float64]
WANDER_GRID = np.concatenate([[0.0], np.geomspace(1e-2, 1e4, 15)])
"""Tried ratios of the wander's variance over the whole span to that of one value."""
LEAST_EVIDENCE = 0.1
"""Gain of log-likelihood that makes a wander: with it the intervals of straight lines cover in 96 %, not in more."""


@dataclass(frozen=True, slots=True)
class Line:
    """A fitted line."""

    rate: float
    """Change a day."""
    rate_low: float
    rate_high: float
    """95 % interval of the rate."""
    wander: float
    """Random walk per square root of a day that was reckoned with, given or found."""
    checked: bool
    """There are points enough to speak of the line and the uncertainties at all: with two, any line fits."""
    contradicted: bool
    """The values scatter about a straight line more than their uncertainties allow (1 % level): no steady trend."""
    _model: "_Fit"
    _widening: float

    def predict(self, day: Array) -> tuple[Array, Array]:
        """True values on later days, shape (m,), and half of their 95 % intervals, each (m,)."""
        mean, variance = self._model.predict(day)
        return mean, self._widening * np.sqrt(variance)


@dataclass(frozen=True, slots=True)
class _Fit:
    """Generalised least squares for one covariance."""

    day: Array
    design: Array
    wander_variance: float
    coefficients: Array
    covariance: Array
    residual: Array
    chi_square: float
    root: Array
    """Lower triangular, of the covariance of all values."""
    log_likelihood: float
    """Restricted, without the scale."""

    def predict(self, day: Array) -> tuple[Array, Array]:
        """Values and variances on later days, (m,) each; the other columns of the design at their mean of zero."""
        rows = np.zeros((len(day), self.design.shape[1]))
        rows[:, 0], rows[:, 1] = 1.0, day
        shared = self.wander_variance * np.minimum.outer(self.day, day) - self.wander_variance * self.day[0]
        weights = np.linalg.solve(self.root.T, np.linalg.solve(self.root, shared))
        away = rows - weights.T @ self.design
        own = self.wander_variance * (day - self.day[0]) - (shared * weights).sum(axis=0)
        variance = own + ((away @ self.covariance) * away).sum(axis=1)
        return rows @ self.coefficients + weights.T @ self.residual, np.maximum(variance, 0.0)


def line_of_measurements(day: Array, value: Array, u_value: Array, wander: float | None = None) -> Line:
    """A line through measurements of known standard uncertainty, all of shape (n,), n >= 2, days rising.

    Without a known wander the likeliest one is found from the values, and where there is any, the interval takes Student's t.
    Raises `CalibrationError` for fewer than two values or uncertainties of zero.
    """
    _refuse(day, u_value)
    freedom = len(day) - 2
    design, errors = _design(day), np.diag(u_value**2)
    straight = _fit(day, value, errors, 0.0, design)
    fit, quantile = straight, NORMAL_975
    if wander is not None:
        fit = _fit(day, value, errors, wander**2, design)
    elif freedom > 0:
        per_day = float(np.mean(u_value**2)) / float(day[-1] - day[0])
        fits = [_fit(day, value, errors, ratio * per_day, design) for ratio in WANDER_GRID]
        fit = max(fits, key=_restricted)
        if _restricted(fit) - _restricted(straight) > LEAST_EVIDENCE:
            quantile = student_quantile(0.975, freedom)
        else:
            fit = straight
    return _line(
        fit,
        widening=quantile,
        wander=fit.wander_variance**0.5,
        checked=freedom > 0,
        contradicted=freedom > 0 and straight.chi_square > chi_square_quantile(0.99, freedom),
    )


def _restricted(fit: _Fit) -> float:
    return fit.log_likelihood - fit.chi_square / 2


def line_of_means(day: Array, value: Array, covariate: Array | None = None) -> Line:
    """A line through many alike means of unknown scatter, shapes (n,), n >= 4: scatter and wander are found from the values.

    `covariate`, such as a temperature, is fitted beside time. Raises `CalibrationError` for too few values.
    """
    design = _design(day, covariate)
    freedom = len(day) - design.shape[1]
    if freedom < 1:
        raise CalibrationError(f"a trend of means needs at least {design.shape[1] + 1} of them, {len(day)} are there")
    span_days = float(day[-1] - day[0])
    fits = [_fit(day, value, np.eye(len(day)), ratio / span_days, design) for ratio in WANDER_GRID]
    best = max(fits, key=lambda fit: fit.log_likelihood - freedom / 2 * np.log(max(fit.chi_square, 1e-300)))
    scatter = float(np.sqrt(best.chi_square / freedom))
    return _line(
        best,
        widening=scatter * student_quantile(0.975, freedom),
        wander=scatter * best.wander_variance**0.5,
        checked=True,
        contradicted=False,
    )


def _line(fit: _Fit, *, widening: float, wander: float, checked: bool, contradicted: bool) -> Line:
    rate, half = float(fit.coefficients[1]), widening * float(np.sqrt(fit.covariance[1, 1]))
    return Line(rate, rate - half, rate + half, wander, checked, contradicted, fit, widening)


def _design(day: Array, covariate: Array | None = None) -> Array:
    columns = [np.ones(len(day)), day] + ([] if covariate is None else [covariate - covariate.mean()])
    return np.stack(columns, axis=1)


def _fit(day: Array, value: Array, error_covariance: Array, wander_variance: float, design: Array) -> _Fit:
    """By orthogonal decomposition: uncertainties may differ by many powers of ten."""
    total = error_covariance + wander_variance * np.minimum.outer(day - day[0], day - day[0])
    try:
        root = np.linalg.cholesky(total)
        white = np.linalg.solve(root, np.column_stack([design, value]))
        orthogonal, upper = np.linalg.qr(white[:, :-1])
        unmix = np.linalg.inv(upper)
    except np.linalg.LinAlgError as error:
        raise CalibrationError(
            "the uncertainties differ too much for a trend; leave the coarse calibration out"
        ) from error
    coefficients = unmix @ orthogonal.T @ white[:, -1]
    white_residual = white[:, -1] - white[:, :-1] @ coefficients
    log_determinants = np.log(np.diag(root)).sum() + np.log(np.abs(np.diag(upper))).sum()
    return _Fit(
        day=day,
        design=design,
        wander_variance=wander_variance,
        coefficients=coefficients,
        covariance=unmix @ unmix.T,
        residual=value - design @ coefficients,
        chi_square=float(white_residual @ white_residual),
        root=root,
        log_likelihood=-float(log_determinants),
    )


def _refuse(day: Array, u_value: Array) -> None:
    if len(day) < 2:
        raise CalibrationError("a drift needs two calibrations at least; keep the earlier record and calibrate again")
    if np.any(np.diff(day) <= 0):
        raise CalibrationError("the calibrations are not at rising times; give each once, oldest first")
    if np.any(u_value <= 0):
        raise CalibrationError(
            "a calibration states no uncertainty (covariance of zero); a drift cannot be judged by it"
        )
