"""Bins of samples and their noise against planted values."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.motion.binning import BinGroups, Binning, BinNoise, ForceBin
from gateway.numerics.array import Array
from tests.values import present


def noise_of(readings: Array) -> BinNoise:
    noise = BinNoise()
    for reading in readings:
        noise.add(reading)
    return noise


def test_bins_hold_means_and_end_at_multiples_of_their_width() -> None:
    time_s: Array = 100.0 + np.arange(61) / 100
    force_g = np.column_stack([time_s, -time_s, np.ones(61)])

    bins = Binning(0.1).add(time_s, force_g)

    assert [one.count for one in bins] == [10] * 6
    np.testing.assert_allclose([one.time_s for one in bins], 100.045 + 0.1 * np.arange(6))
    np.testing.assert_allclose([one.force_g for one in bins], [[t, -t, 1.0] for t in 100.045 + 0.1 * np.arange(6)])
    assert not any(one.is_clipped for one in bins)


@pytest.mark.parametrize("block", [1, 3, 7, 250])
def test_bins_are_the_same_for_blocks_of_any_size(block: int) -> None:
    rng = np.random.default_rng(block)
    time_s: Array = np.sort(rng.uniform(0, 3, 250))
    force_g = rng.normal(size=(250, 3))
    whole = Binning(0.1).add(time_s, force_g)

    binning = Binning(0.1)
    parts = [one for n in range(0, 250, block) for one in binning.add(time_s[n : n + block], force_g[n : n + block])]

    assert [(one.count, one.is_clipped) for one in parts] == [(one.count, one.is_clipped) for one in whole]
    np.testing.assert_allclose([one.time_s for one in parts], [one.time_s for one in whole], rtol=1e-12)
    np.testing.assert_allclose([one.force_g for one in parts], [one.force_g for one in whole], atol=1e-12)


def test_samples_on_the_edges_belong_to_the_bins_that_they_begin() -> None:
    time_s: Array = 0.02 * np.arange(5001, dtype=np.float64)

    bins = Binning(0.1).add(time_s, np.ones((5001, 3)))

    assert {one.count for one in bins} == {5}


def test_every_sample_is_in_one_bin() -> None:
    time_s = np.sort(np.random.default_rng(1).uniform(0, 10, 500))

    bins = Binning(0.1).add(np.append(time_s, 20.0), np.ones((501, 3)))

    assert sum(one.count for one in bins) == 500


@pytest.mark.parametrize("block", [1, 5, 25, 50])
def test_clipped_samples_mark_their_own_bin_and_no_other(block: int) -> None:
    time_s: Array = np.arange(50) / 100
    is_clipped = np.arange(50) == 15
    binning = Binning(0.1)

    bins = [
        one
        for n in range(0, 50, block)
        for one in binning.add(time_s[n : n + block], np.ones((block, 3)), is_clipped[n : n + block])
    ]

    assert [one.is_clipped for one in bins] == [False, True, False, False]


def test_bin_with_a_reading_that_is_no_number_is_not_usable() -> None:
    force_g = np.ones((30, 3))
    force_g[12, 1] = np.nan

    bins = Binning(0.1).add(np.arange(30) / 100, force_g)

    assert [one.is_usable for one in bins] == [True, False]


@pytest.mark.slow
def test_noise_of_the_bins_is_the_planted_one() -> None:
    rng = np.random.default_rng(1)
    sigma_g = np.array([2e-4, 2e-4, 5e-4])

    found = np.array([noise_of(sigma_g * rng.normal(size=(100, 3))).sigma_g(0.0) for _ in range(100)])

    np.testing.assert_allclose(np.sqrt((found**2).mean(axis=0)), sigma_g, rtol=0.05)


def test_slow_swing_is_not_counted_as_noise() -> None:
    """Ten degrees at mid-rope and a period of 6 s in bins of 0.1 s."""
    phase = 2 * np.pi / 6 * 0.1 * np.arange(200)
    swing = np.column_stack([0.087 * np.cos(phase), 0.04 * np.sin(phase), 1 + 0.01 * np.cos(2 * phase)])
    rng = np.random.default_rng(2)

    noise = noise_of(swing + 3e-4 * rng.normal(size=swing.shape))

    np.testing.assert_allclose(noise.sigma_g(0.0), 3e-4, rtol=0.8)


def test_both_transverse_axes_have_one_noise() -> None:
    x, y, _ = noise_of(np.random.default_rng(3).normal(size=(50, 3)) * [1e-3, 1e-4, 1e-4]).sigma_g(0.0)

    assert x == y


def test_stated_noise_is_the_least() -> None:
    quiet = noise_of(1e-6 * np.random.default_rng(4).normal(size=(50, 3)))

    np.testing.assert_array_equal(quiet.sigma_g(1e-4), 1e-4)
    np.testing.assert_array_equal(BinNoise().sigma_g(7e-4), 7e-4)
    assert not BinNoise().is_known
    assert quiet.is_known


def test_impact_of_one_bin_raises_the_noise_for_a_few_seconds_only() -> None:
    rng = np.random.default_rng(5)
    readings = 1e-4 * rng.normal(size=(160, 3))
    readings[50] += 0.5

    assert noise_of(readings[:52]).sigma_g(0.0)[0] < 3e-3
    assert noise_of(readings).sigma_g(0.0)[0] < 3e-4


def test_bins_on_either_side_of_a_gap_are_not_compared() -> None:
    rng = np.random.default_rng(6)
    noise = noise_of(1e-4 * rng.normal(size=(50, 3)))
    before = noise.sigma_g(0.0)

    noise.clear()
    for reading in 0.1 + 1e-4 * rng.normal(size=(3, 3)):
        noise.add(reading)

    np.testing.assert_array_equal(noise.sigma_g(0.0), before)


def long_bins(time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_], block: int) -> list[ForceBin]:
    """Long bins of five short ones, out of blocks."""
    binning, groups, found = Binning(0.1), BinGroups(0.1, 5), []
    for n in range(0, len(time_s), block):
        for one in binning.add(time_s[n : n + block], force_g[n : n + block], is_clipped[n : n + block]):
            found += groups.add(one)
    for one in binning.finish():
        found += groups.add(one)
    return found + groups.finish()


@pytest.mark.parametrize("block", [1, 7, 60, 1000])
def test_long_bins_are_means_of_their_samples_for_blocks_of_any_size(block: int) -> None:
    rng = np.random.default_rng(7)
    time_s: Array = 3.0 + np.arange(1000) / 100
    force_g = rng.normal(size=(1000, 3))

    found = long_bins(time_s, force_g, np.zeros(1000, dtype=bool), block)

    assert [one.count for one in found] == [50] * 20
    np.testing.assert_allclose([one.time_s for one in found], time_s.reshape(20, 50).mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose([one.force_g for one in found], force_g.reshape(20, 50, 3).mean(axis=1), atol=1e-12)
    assert all(one.is_usable for one in found)


def test_short_bins_that_cannot_be_used_are_left_out_of_the_long_one() -> None:
    rng = np.random.default_rng(8)
    time_s: Array = np.arange(150) / 100
    force_g, is_clipped = rng.normal(size=(150, 3)), np.zeros(150, dtype=bool)
    is_clipped[12] = True
    force_g[73] = np.nan
    kept = np.ones(150, dtype=bool)
    kept[10:20], kept[70:80] = False, False

    found = long_bins(time_s, force_g, is_clipped, 25)

    assert [one.count for one in found] == [40, 40, 50]
    assert all(one.is_usable for one in found)
    for n, one in enumerate(found):
        samples = slice(50 * n, 50 * (n + 1))
        np.testing.assert_allclose(one.time_s, time_s[samples][kept[samples]].mean())
        np.testing.assert_allclose(one.force_g, force_g[samples][kept[samples]].mean(axis=0))


def test_long_bin_of_clipped_ones_alone_is_not_usable() -> None:
    is_clipped = np.zeros(150, dtype=bool)
    is_clipped[50:100:5] = True

    found = long_bins(np.arange(150) / 100, np.ones((150, 3)), is_clipped, 10)

    assert [one.is_usable for one in found] == [True, False, True]
    assert found[1].time_s == pytest.approx(0.745)


def test_long_bins_on_either_side_of_a_gap_are_apart() -> None:
    time_s: Array = np.arange(200) / 100
    kept = (time_s < 0.315) | (time_s > 1.285)

    found = long_bins(time_s[kept], np.ones((int(kept.sum()), 3)), np.zeros(int(kept.sum()), dtype=bool), 9)

    assert [one.count for one in found] == [32, 21, 50]


def test_long_bin_has_a_rate_where_all_of_its_short_ones_have() -> None:
    rates = [np.full(3, float(n)) for n in range(10)]
    groups, found = BinGroups(0.1, 5), []
    for n, rate in enumerate(rates):
        found += groups.add(ForceBin(0.1 * n + 0.05, np.ones(3), 10, False, None if n == 7 else rate))

    assert present(found[0].rate_rad_s) == pytest.approx(np.full(3, 2.0))
    assert found[1].rate_rad_s is None


def test_scatter_within_a_long_bin_is_the_spread_of_its_mean() -> None:
    rng = np.random.default_rng(9)
    time_s: Array = np.arange(100_000) / 100
    slope_g_s: Array = np.array([0.2, -0.1, 0.05])
    force_g = np.multiply.outer(time_s % 1.0, slope_g_s) + 1e-3 * rng.normal(
        size=(100_000, 3)
    )  # breaks between bins alone

    found = long_bins(time_s, force_g, np.zeros(100_000, dtype=bool), 1000)

    squared_g2 = np.mean([np.square(present(one.scatter_g)) for one in found], axis=0)
    assert np.sqrt(squared_g2) == pytest.approx(np.full(3, 1e-3 / np.sqrt(50)), rel=0.06)


def test_scatter_needs_three_short_bins() -> None:
    groups, found = BinGroups(0.1, 5), []
    for n in range(7):
        found += groups.add(ForceBin(0.1 * n + 0.05, np.array([0.0, 0.0, 1.0]), 10, n in (1, 2, 3)))
    found += groups.finish()

    assert [one.scatter_g for one in found] == [None, None]
