"""Intervals of fitted values, under white, slow and narrow-band noise, and with a companion that is too small to be named."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from gateway.numerics.stats import NORMAL_975
from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.reconcile.fit.intervals import (
    coloured_covariance,
    intervals,
    mixture_interval,
    noise_density,
    standard_uncertainties,
)
from gateway.twin.reconcile.fit.multiple_shooting import Fit

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
    """Return autoregressive noise of unit variance, shape (n, 3); without poles it is white, with a pole at 1 a random walk."""
    white = rng.normal(size=(3 * len(TIME_S), 3))
    if 1 in poles:
        return np.asarray(np.cumsum(white[: len(TIME_S)], axis=0) * np.sqrt(3 / len(TIME_S)))
    made: Array = lfilter([1.0], np.poly(poles).real, white, axis=0)[-len(TIME_S) :]
    scaled: Array = made / made.std()
    return scaled


@dataclass(frozen=True)
class Intervals:
    """Of four values in many trials."""

    covered: Array
    """Share of the 95 % intervals that hold the true value 0."""
    covered_if_white: Array
    """The same of intervals for white noise."""
    width: Array
    """Median of the half interval over the true one."""


@functools.cache
def under_noise(poles: tuple[complex, ...]) -> Intervals:
    """Return what intervals are worth under noise with these poles."""
    jacobian = sensitivities()
    flat = jacobian.reshape(-1, 4)
    solve, normal = np.linalg.pinv(flat), flat.T @ flat
    values, sigma, white = np.zeros((3, TRIALS, 4))
    for trial in range(TRIALS):
        measured = noise(np.random.default_rng(trial), poles)
        values[trial] = solve @ measured.ravel()
        observations = Observations(TIME_S, measured, None, np.ones(3), np.ones(len(TIME_S), dtype=bool))
        fit = Fit((), values[trial], np.ones(4, dtype=bool), jacobian @ values[trial], 1.0, normal, jacobian)
        sigma[trial] = np.sqrt(np.diag(coloured_covariance(fit, observations)))
        white[trial] = np.sqrt(np.diag(fit.covariance()))
    covered, covered_if_white = ((np.abs(values) < NORMAL_975 * each).mean(axis=0) for each in (sigma, white))
    return Intervals(covered, covered_if_white, np.median(sigma, axis=0) / np.sqrt((values**2).mean(axis=0)))


@pytest.mark.slow
def test_intervals_of_white_noise_stay_nearly_as_they_were() -> None:
    found = under_noise(())
    assert (found.covered >= found.covered_if_white).all()
    assert found.covered.mean() == pytest.approx(0.95, abs=0.02)
    assert (found.width < 1.15).all()


@pytest.mark.slow
@pytest.mark.parametrize("poles", [(0.9,), (0.7, 0.8), (0.98,), (0.995,), (1,)])
def test_intervals_cover_under_slow_noise_and_are_not_twice_too_wide(poles: tuple[complex, ...]) -> None:
    found = under_noise(poles)
    assert (found.covered > 0.88).all()
    assert found.covered.mean() > 0.92
    assert (found.width < 2).all()
    assert found.covered_if_white.min() < 0.6


@pytest.mark.slow
def test_intervals_are_wider_where_a_disturbance_has_the_frequency_of_the_swing() -> None:
    pole = 0.99 * np.exp(2j * np.pi * SWING_HZ * 0.05)
    found = under_noise((pole, np.conj(pole)))
    assert (found.covered[:3] > 0.85).all()
    assert (found.covered_if_white[:3] < 0.4).all()
    assert (found.width < 2).all()


@pytest.mark.parametrize("level", [1.0, 4.0, 100.0])
def test_density_of_white_noise_is_its_level(level: float) -> None:
    power = level * np.random.default_rng(5).normal(size=1000) ** 2
    density = noise_density(power, np.ones(1000), np.arange(1000))
    assert np.median(density) == pytest.approx(level, rel=0.1)
    assert density.min() > 0.8 * level


def test_density_at_zero_continues_the_slope_of_slow_noise() -> None:
    power = 1 + 4000 / (1 + (np.arange(1000) / 4.0) ** 2)
    left = np.ones(1000)
    power[0] = left[0] = 0.0  # the fit took it
    at_zero, at_one, far = noise_density(power, left, np.array([0, 1, 600]))
    assert at_zero > at_one > 4000
    assert far < 60


def test_density_is_no_smaller_than_the_stated_noise() -> None:
    assert noise_density(np.full(200, 0.01), np.ones(200), np.array([0, 50])) == pytest.approx(1.0, abs=0.05)


def ends(
    model: Model, log: Observations, name: str, stated: EffectValues | None = None
) -> tuple[tuple[float, float], float, float]:
    """The interval of the first value of an effect that is fitted alone, that value, and half its interval without companions."""
    setting = FitContext(model.rig, stated or {}, log, lambda: None)
    fit = setting.fit({name: {}})
    simulator = setting.simulator((name,))
    first = next(i for i, spec in enumerate(simulator.parameters) if spec.effect == name)
    companions = EFFECTS.choose(is_scored=True, needs_temperature=False)
    below, above = intervals(setting, fit, {name: simulator.effects(fit.values)[name]}, companions, 1.0)
    value = float(fit.values[first])
    plain = NORMAL_975 * float(standard_uncertainties(fit, log)[first])
    return (value - float(below[first]), value + float(above[first])), value, plain


@pytest.mark.slow
def test_drag_allows_for_a_damping_that_is_too_small_to_be_named(
    model: Model, record: Callable[..., Observations]
) -> None:
    log = record({"quadratic_drag": {"drag_per_m": 0.012}, "viscous_damping": {"damping_ratio": 0.0004}})
    (low, high), value, plain = ends(model, log, "quadratic_drag")

    assert value - plain > 0.012
    assert low < 0.012 < high
    assert high < value + 1.5 * plain  # a loss beside it can only take a part of the drag


@pytest.mark.slow
def test_a_companion_that_the_rig_states_is_none(model: Model, record: Callable[..., Observations]) -> None:
    losses: EffectValues = {"viscous_damping": {"damping_ratio": 0.0004}, "coulomb_friction": {"decel_m_s2": 0.0}}
    log = record({"quadratic_drag": {"drag_per_m": 0.012}, "viscous_damping": {"damping_ratio": 0.0004}})
    (low, high), _, plain = ends(model, log, "quadratic_drag", losses)

    assert low < 0.012 < high
    assert high - low < 2 * 1.5 * plain


@pytest.mark.slow
def test_an_interval_hardly_widens_where_no_companion_shows(model: Model, record: Callable[..., Observations]) -> None:
    (low, high), _, plain = ends(model, record({"rope_length": {"relative_error": 0.02}}), "rope_length")

    assert low < 0.02 < high
    assert high - low < 2 * 1.5 * plain


def test_interval_of_a_mixture() -> None:
    nowhere, far = np.zeros(64), np.full(64, 100.0)

    assert mixture_interval(nowhere, 2.0, 1.0) == pytest.approx((-2 * NORMAL_975, 2 * NORMAL_975), rel=1e-6)
    assert mixture_interval(far, 1.0, 0.0) == pytest.approx((-NORMAL_975, NORMAL_975), rel=1e-6)
    # Half of the probability is at each place: 5 % of either are outside.
    assert mixture_interval(far, 1.0, 1.0) == pytest.approx((-1.644854, 101.644854), rel=1e-5)
