"""Bins, noise measured from the samples, and checks of the input."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from devices.axes_map import map_axes, parse_axes_map
from gateway.numerics.stats import smallest_steps
from gateway.swing.data.bins import bin_samples, concatenate, merge
from gateway.swing.data.input_checks import (
    effective_noise_g,
    find_fault,
    find_fault_in_means,
    lacks_gravity,
    measured_noise_g,
)
from tests.gateway.swing.held_pendulum import readings_g, swing
from tests.values import present

RNG = np.random.default_rng(3)


def test_quadrature_reproduces_the_mean_over_a_bin() -> None:
    """The mean of a slow signal over a bin is its mean at two times, also with uneven and missing samples."""
    time_s = np.sort(RNG.uniform(0.0, 20.0, 900))
    signal = np.sin(2.1 * time_s)

    bins = bin_samples(time_s, np.stack([signal] * 3, axis=1), 0.2)

    assert np.abs(np.sin(2.1 * bins.quadrature_times_s()).mean(axis=0) - bins.force_g[:, 0]).max() < 5e-4
    centre = np.sin(2.1 * bins.time_s)
    assert np.abs(centre - bins.force_g[:, 0]).max() > 5e-3  # the error without quadrature


@pytest.mark.slow
@given(st.integers(1, 400), st.integers(1, 60))
def test_binning_in_blocks_is_binning_at_once(count: int, cut: int) -> None:
    time_s = np.linspace(0.0, 7.0, count)
    force_g = np.random.default_rng(count).normal(size=(count, 3))
    cut = min(cut, count)

    at_once = bin_samples(time_s, force_g, 0.5)
    early, late = (bin_samples(time_s[part], force_g[part], 0.1) for part in (slice(cut), slice(cut, None)))
    in_blocks = merge(concatenate(early, late), 0.5)

    assert in_blocks.count == pytest.approx(at_once.count)
    assert in_blocks.time_s == pytest.approx(at_once.time_s)
    assert in_blocks.spread_s == pytest.approx(at_once.spread_s, abs=1e-7)
    assert in_blocks.force_g == pytest.approx(at_once.force_g)


def test_noise_is_measured_despite_a_fast_swing_and_spikes() -> None:
    time_s = np.arange(600) / 10.0
    swing = 0.1 * np.sin(2 * np.pi * time_s / 2.5)
    force_g = swing[:, None] + [[1e-3, 2e-3, 4e-4]] * RNG.normal(size=(600, 3))
    force_g[::97] += 0.5

    assert measured_noise_g(force_g) == pytest.approx([1e-3, 2e-3, 4e-4], rel=0.25)


def test_effective_noise_is_at_least_that_of_quantisation_and_the_stated_one() -> None:
    coarse = np.round(RNG.normal(scale=1e-4, size=(500, 3)) / 0.004) * 0.004 + [[0.0, 0.004, 1.0]]
    coarse[7] += 0.004

    assert smallest_steps(coarse) == pytest.approx([0.004] * 3)
    assert (effective_noise_g(coarse, None) >= 0.004 / np.sqrt(12)).all()
    assert effective_noise_g(RNG.normal(scale=1e-3, size=(500, 3)), 5e-3) == pytest.approx([5e-3] * 3)
    assert effective_noise_g(RNG.normal(scale=1e-3, size=(500, 3)), 1e-4) == pytest.approx([1e-3] * 3, rel=0.2)


def swinging_g() -> NDArray[np.float64]:
    time_s = np.arange(2000) / 50.0
    swing = 0.08 * np.sin(2 * np.pi * time_s / 6.0)
    ideal = np.stack([swing, 0.3 * swing, 1.0 + 0.1 * swing**2], axis=1)
    return ideal + 5e-4 * RNG.normal(size=(2000, 3))


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (lambda f: f * [1, 0, 1], "y does not change"),
        (lambda f: np.minimum(f, [0.04, 9, 9]), "clipped: many readings of x are exactly +0.0400 g"),
        (lambda f: np.maximum(f, [-9, -0.02, -9]), "clipped: many readings of y are exactly -0.0200 g"),
        (lambda f: f * 1.25, "wrong unit or scale"),
        (lambda f: f * 9.80665, "wrong unit or scale"),
        (lambda f: f - [0, 0, 1], "gravity is missing"),
        (lambda f: f * [1, -1, -1], "not upright"),
        (lambda f: f[:, [2, 0, 1]], "not upright"),
    ],
)
def test_implausible_data_are_reported_with_their_fault(spoil: Callable[..., Any], fault: str) -> None:
    assert fault in present(find_fault(spoil(swinging_g())))


@pytest.mark.parametrize("mounted", ["z,x,y", "z,y,-x", "x,-z,y", "x,z,-y", "x,-y,-z"])
def test_the_axes_that_are_proposed_for_a_housing_that_is_not_upright_mend_it(mounted: str) -> None:
    force_g = map_axes(swinging_g(), parse_axes_map(mounted))
    proposed = present(find_fault(force_g)).partition("--axes ")[2]
    assert find_fault(map_axes(force_g, parse_axes_map(proposed))) is None


def test_a_swing_and_a_coarse_sensor_at_rest_have_no_fault() -> None:
    assert find_fault(swinging_g()) is None
    rest = np.array([[0.0, 0.0, 1.0]]) + 1e-3 * RNG.normal(size=(3000, 3))
    assert find_fault(np.round(rest / 0.0039) * 0.0039) is None


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_deg", [5.0, 30.0, 60.0, 90.0, 110.0])
@pytest.mark.parametrize("rho", [0.0, 0.3, 0.7, 1.0])
def test_the_mean_of_a_wide_swing_is_plausible_in_g_alone(amplitude_deg: float, rho: float) -> None:
    amplitude_rad = np.radians([amplitude_deg])
    _, motion = swing(amplitude_rad, 0 * amplitude_rad, 0 * amplitude_rad, 4)
    force_g, _ = readings_g(motion[:, 0], rho)
    assert find_fault_in_means(force_g + 1e-3 * RNG.normal(size=force_g.shape)) is None
    for units_per_g in (9.80665, 1000.0, 32.174):
        assert "wrong unit" in present(
            find_fault_in_means(units_per_g * force_g + 1e-3 * RNG.normal(size=force_g.shape))
        )


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.1, 0.5, 1.0])
def test_a_swing_without_gravity_is_said_so(rho: float) -> None:
    amplitude_rad = np.radians([40.0])
    _, motion = swing(amplitude_rad, 0 * amplitude_rad, 0 * amplitude_rad, 8)
    force_g, still_g = readings_g(motion[:, 0], rho)
    upright = np.sqrt(1 - (still_g**2).sum(axis=1))
    linear_g = force_g - np.column_stack([still_g, upright]) + 1e-3 * RNG.normal(size=force_g.shape)
    assert "gravity is missing" in present(find_fault_in_means(linear_g))


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.1, 0.3])
def test_a_swing_far_above_the_pivot_has_gravity_though_its_mean_is_small(rho: float) -> None:
    amplitude_rad = np.radians([125.0])
    _, motion = swing(amplitude_rad, 0 * amplitude_rad, 0 * amplitude_rad, 8)
    force_g, _ = readings_g(motion[:, 0], rho)
    assert np.linalg.norm(force_g.mean(axis=0)) < 0.33 or rho > 0.1
    assert not lacks_gravity(force_g + 1e-3 * RNG.normal(size=force_g.shape))
    assert find_fault_in_means(force_g + 1e-3 * RNG.normal(size=force_g.shape)) is None
