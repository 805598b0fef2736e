"""Angles, bootstrap, colour, lines, the null test: against known answers."""

import numpy as np
import pytest

from gateway.numerics.spectrum import find_machine_line
from gateway.numerics.stats import chi_square_tail
from gateway.twin.reconcile.fit.validation import block_bootstrap_gain
from gateway.twin.reconcile.residual.isolability import confusable, smallest_angle_cosine
from gateway.twin.reconcile.residual.noise_inflation import noise_inflation_factor
from gateway.twin.reconcile.residual.surrogate_test import normal_score, null_threshold, phase_randomised_surrogate
from gateway.twin.reconcile.residual.whiteness import find_peaks, ljung_box_p

RATE_HZ = 20.0
TIME_S = np.arange(1200) / RATE_HZ


def coloured(rng, memory, shape=(1200, 3)):
    noise = rng.normal(size=shape)
    for i in range(1, len(noise)):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    return noise


@pytest.mark.parametrize("angle_deg", [5.0, 30.0, 80.0])
def test_the_planted_angle_between_two_spaces_is_found(angle_deg):
    rng = np.random.default_rng(3)
    basis, _ = np.linalg.qr(rng.normal(size=(50, 4)))
    angle = np.radians(angle_deg)
    first = basis[:, :2] @ rng.normal(size=(2, 2))
    second = np.stack([np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 2], basis[:, 3]], axis=1)

    assert smallest_angle_cosine(first, second) == pytest.approx(np.cos(angle), abs=1e-9)


def test_only_close_effects_are_reported_as_confusable():
    rng = np.random.default_rng(4)
    column = rng.normal(size=(60, 1))
    near, far = column + 0.05 * rng.normal(size=(60, 1)), rng.normal(size=(60, 1))

    assert [(pair.first, pair.second) for pair in confusable({"a": column, "b": near, "c": far})] == [("a", "b")]


def test_the_bootstrap_interval_covers_the_true_gain_under_correlated_noise():
    covered, trials = 0, 60
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        after = coloured(rng, 0.7)
        before = after + 0.5 * np.sin(2 * np.pi * 0.2 * TIME_S)[:, None]
        low, high = block_bootstrap_gain(before, after, TIME_S, rng)
        covered += low < 0.125 < high

    assert covered >= 0.85 * trials  # nominally 95 %; blocks of a finite recording give a little less


def test_colour_is_the_spectral_density_of_slow_noise_over_that_of_white_noise():
    rng = np.random.default_rng(5)
    memory = 0.8

    assert noise_inflation_factor(TIME_S, rng.normal(size=(1200, 3))) == pytest.approx(1.0, abs=0.2)
    assert noise_inflation_factor(TIME_S, coloured(rng, memory)) > 0.4 * (1 + memory) / (1 - memory)


@pytest.mark.slow
def test_noise_of_any_colour_stays_below_what_the_null_test_allows():
    rng = np.random.default_rng(6)
    signatures = {str(k): np.cumsum(rng.normal(size=(3600, 2)), axis=0) for k in range(8)}
    alarms = 0
    for trial in range(40):
        residual = coloured(np.random.default_rng([7, trial]), 0.9)
        reached = -np.inf
        for columns in signatures.values():
            basis, _ = np.linalg.qr(columns)
            reached = max(reached, normal_score(float(((basis.T @ residual.ravel()) ** 2).sum()), 2))
        alarms += reached > null_threshold(signatures, residual, rng)

    assert alarms == 0


def test_a_surrogate_has_the_spectrum_of_the_noise_and_other_values():
    rng = np.random.default_rng(8)
    residual = coloured(rng, 0.9)
    drawn = phase_randomised_surrogate(residual, rng)

    np.testing.assert_allclose(np.abs(np.fft.rfft(drawn, axis=0)), np.abs(np.fft.rfft(residual, axis=0)), atol=1e-6)
    assert abs(np.corrcoef(drawn[:, 0], residual[:, 0])[0, 1]) < 0.5


def test_ljung_box_tells_white_from_coloured():
    rng = np.random.default_rng(9)

    assert ljung_box_p(rng.normal(size=(1200, 3))) > 0.001
    assert ljung_box_p(coloured(rng, 0.3)) < 1e-6


def test_the_tail_of_chi_square_agrees_with_the_table():
    assert chi_square_tail(18.307, 10) == pytest.approx(0.05, abs=0.001)


def test_a_line_is_found_at_its_frequency_and_none_in_slow_noise():
    rng = np.random.default_rng(10)
    noise_g = np.full(3, 1e-3)
    residual_g = 1e-3 * coloured(rng, 0.9)
    shaken_g = residual_g + 1e-3 * np.sin(2 * np.pi * 6.37 * TIME_S)[:, None]
    found = find_machine_line(TIME_S, shaken_g, noise_g)

    assert find_machine_line(TIME_S, residual_g, noise_g) is None
    assert found is not None
    assert found.frequency_hz == pytest.approx(6.37, abs=0.002)
    assert [p for p in find_peaks(TIME_S, shaken_g / noise_g, noise_g) if abs(p.hz - 6.37) < 0.05]
