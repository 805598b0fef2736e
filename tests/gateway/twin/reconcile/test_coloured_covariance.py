"""Intervals of fitted values under white, slow and narrow-band noise, on a linear model of a decaying swing."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from gateway.numerics.stats import NORMAL_975
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.coloured_covariance import coloured_covariance
from gateway.twin.reconcile.fit.fit_result import Fit

Array = NDArray[np.float64]
TIME_S = np.arange(0, 60, 0.05)
SWING_HZ = 0.2
TRIALS = 100


def sensitivities() -> Array:
    """Return those by amplitude and phase of x, by a damping of it, and by an offset of y, shape (n, 3, 4)."""
    angle = 2 * np.pi * SWING_HZ * TIME_S
    jacobian = np.zeros((len(TIME_S), 3, 4))
    jacobian[:, 0, :3] = np.stack([np.cos(angle), np.sin(angle), TIME_S / 60 * np.cos(angle)], axis=1)
    jacobian[:, 1, 3] = 1.0
    return jacobian


def noise(rng: np.random.Generator, poles: tuple[complex, ...]) -> Array:
    """Return autoregressive noise of unit variance, shape (n, 3); without poles it is white."""
    white = rng.normal(size=(3 * len(TIME_S), 3))
    made: Array = lfilter([1.0], np.poly(poles).real, white, axis=0)[-len(TIME_S) :]
    scaled: Array = made / made.std()
    return scaled


def covered(poles: tuple[complex, ...]) -> tuple[Array, Array]:
    """Return the share of 95 % intervals that hold the true value 0: of this covariance, and of the one for white noise."""
    jacobian = sensitivities()
    flat = jacobian.reshape(-1, 4)
    solve, normal = np.linalg.pinv(flat), flat.T @ flat
    is_inside = np.zeros((2, TRIALS, 4), dtype=bool)
    for trial in range(TRIALS):
        measured = noise(np.random.default_rng(trial), poles)
        values = solve @ measured.ravel()
        used = np.ones(len(TIME_S), dtype=bool)
        observations = Observations(TIME_S, measured, None, np.ones(3), used)
        fit = Fit((), values, np.ones(4, dtype=bool), jacobian @ values, 1.0, normal, jacobian)
        for i, covariance in enumerate((coloured_covariance(fit, observations), fit.covariance())):
            is_inside[i, trial] = np.abs(values) < NORMAL_975 * np.sqrt(np.diag(covariance))
    found, white = is_inside.mean(axis=1)
    return found, white


def test_intervals_of_white_noise_stay_nearly_as_they_were() -> None:
    found, white = covered(())
    assert (white > 0.9).all()
    assert (found >= white).all()


@pytest.mark.parametrize("poles", [(0.9,), (0.7, 0.8)])
def test_intervals_cover_under_slow_noise(poles: tuple[complex, ...]) -> None:
    found, white = covered(poles)
    assert (found > 0.86).all()
    assert (white < 0.7).all()


def test_intervals_are_wider_where_a_disturbance_has_the_frequency_of_the_swing() -> None:
    pole = 0.99 * np.exp(2j * np.pi * SWING_HZ * 0.05)
    found, white = covered((pole, np.conj(pole)))
    assert (found[:3] > 0.85).all()
    assert (white[:3] < 0.4).all()
