"""Statistics of residuals and signatures against known answers, and what is left of a motion, planted."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from gateway.numerics.spectrum import find_machine_line
from gateway.twin.experiment_design.plan import smallest_angle_cosine
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Curves
from gateway.twin.reconcile.output.serialisation import to_json, to_text
from gateway.twin.reconcile.residual import (
    describe_remainder,
    find_peaks,
    ljung_box_p,
    localise_residual,
    multiple_of_swing,
    noise_inflation_factor,
    swing_frequency_hz,
)
from gateway.twin.reconcile.search.validation import block_bootstrap_gain
from tests.gateway.twin.report.conftest import made

Array = NDArray[np.float64]
RATE_HZ = 20.0
TIME_S = np.arange(1200) / RATE_HZ
SWING_HZ = 0.15
"""The rope of the rig would swing at 0.13 Hz."""
LOG_NOISE_G = 1e-3
LOG_S = np.arange(0, 120, 0.04)
AZIMUTH_RAD = 0.5
ALONG, ACROSS = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (AZIMUTH_RAD, AZIMUTH_RAD + np.pi / 2))
UP = np.array([0.0, 0.0, 1.0])


def coloured_noise(rng: np.random.Generator, memory: float) -> Array:
    """Return noise (1200, 3) of a process of first order with unit variance."""
    noise = rng.normal(size=(1200, 3))
    for i in range(1, len(noise)):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    return noise


@pytest.mark.parametrize("angle_deg", [5.0, 30.0, 80.0])
def test_smallest_principal_angle_between_two_spaces(angle_deg: float) -> None:
    rng = np.random.default_rng(3)
    basis, _ = np.linalg.qr(rng.normal(size=(50, 4)))
    angle = np.radians(angle_deg)
    first = basis[:, :2] @ rng.normal(size=(2, 2))
    second = np.stack([np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 2], basis[:, 3]], axis=1)

    assert smallest_angle_cosine(first, second) == pytest.approx(np.cos(angle), abs=1e-9)


@pytest.mark.slow
def test_bootstrap_interval_covers_the_true_gain_under_correlated_noise() -> None:
    covered, trials = 0, 60
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        after = coloured_noise(rng, 0.7)
        before = after + 0.5 * np.sin(2 * np.pi * 0.2 * TIME_S)[:, None]
        low, high = block_bootstrap_gain(before, after, 1 / RATE_HZ, rng)
        covered += low < 0.125 < high

    assert covered >= 0.85 * trials  # nominally 95 %; blocks of a finite recording give a little less


def test_noise_inflation_is_the_spectral_density_of_slow_noise_over_that_of_white_noise() -> None:
    rng = np.random.default_rng(5)
    memory = 0.8

    assert noise_inflation_factor(TIME_S, rng.normal(size=(1200, 3))) == pytest.approx(1.0, abs=0.2)
    assert noise_inflation_factor(TIME_S, coloured_noise(rng, memory)) > 0.4 * (1 + memory) / (1 - memory)


def test_ljung_box_distinguishes_white_from_coloured_noise() -> None:
    rng = np.random.default_rng(9)

    assert ljung_box_p(rng.normal(size=(1200, 3))) > 0.001
    assert ljung_box_p(coloured_noise(rng, 0.3)) < 1e-6


def test_ljung_box_probability_is_the_tail_of_chi_square() -> None:
    axis = np.tile([1.0, 2.0, -3.0, 0.5, -0.5], 4)  # 20 samples, 4 lags, mean 0
    rho = np.array([(axis[k:] * axis[:-k]).sum() for k in range(1, 5)]) / (axis**2).sum()
    statistic = 20 * 22 * (rho**2 / (20 - np.arange(1, 5))).sum()

    assert ljung_box_p(axis[:, None]) == pytest.approx(chi2.sf(statistic, 4))


def test_machine_line_is_found_at_its_frequency_and_none_in_slow_noise() -> None:
    rng = np.random.default_rng(10)
    noise_g = np.full(3, 1e-3)
    residual_g = 1e-3 * coloured_noise(rng, 0.9)
    shaken_g = residual_g + 1e-3 * np.sin(2 * np.pi * 6.37 * TIME_S)[:, None]
    found = find_machine_line(TIME_S, shaken_g, noise_g)

    assert find_machine_line(TIME_S, residual_g, noise_g) is None
    assert found is not None
    assert found.frequency_hz == pytest.approx(6.37, abs=0.002)
    assert [p for p in find_peaks(TIME_S, shaken_g / noise_g, noise_g) if abs(p.hz - 6.37) < 0.05]


def test_residual_is_localised_in_time_axis_and_band() -> None:
    residual = np.random.default_rng(11).normal(size=(1200, 3))
    residual[400:600, 1] += 3 * np.sin(2 * np.pi * 0.9 * TIME_S[400:600])
    (found,) = localise_residual(TIME_S, residual)

    assert found.axis == "y"
    assert (found.from_s, found.to_s) == pytest.approx((20.0, 30.0), abs=0.1)
    assert found.band_hz[0] < 0.9 < found.band_hz[1]
    assert found.rms_sigma == pytest.approx(np.sqrt(1 + 4.5), rel=0.1)


@pytest.fixture
def rig() -> TwinRig:
    return made("unmodelled").rig


def sine(hz: float, amplitude_g: float) -> np.ndarray:
    wave: np.ndarray = amplitude_g * np.sin(2 * np.pi * hz * LOG_S)[:, None]
    return wave


def recorded(swing_g: np.ndarray, left_g: np.ndarray) -> Curves:
    """The nominal model simulates nothing that swings; the final one all but what is left."""
    noise_g = LOG_NOISE_G * np.random.default_rng(2).normal(size=(len(LOG_S), 3))
    still, used = np.zeros_like(noise_g), np.ones(len(LOG_S), dtype=bool)
    return Curves(LOG_S, swing_g + left_g + noise_g, still, swing_g, used, np.full(3, LOG_NOISE_G))


@pytest.mark.parametrize(
    ("hz", "multiple"), [(0.15, 1), (0.302, 2), (0.445, 3), (0.6, 4), (0.75, None), (0.335, None), (0.05, None)]
)
def test_a_line_is_at_a_multiple_of_what_the_load_swings_at(rig: TwinRig, hz: float, multiple: int | None) -> None:
    log = recorded(sine(SWING_HZ, 0.05) * ALONG, np.zeros(3))
    assert multiple_of_swing(hz, swing_frequency_hz(log, rig), log) == multiple


def test_near_the_load_where_nothing_swings_across_the_rig_tells_the_frequency(rig: TwinRig) -> None:
    log = recorded(0 * LOG_S[:, None] * UP, np.zeros(3))
    assert multiple_of_swing(2 / rig.small_swing_period_s, swing_frequency_hz(log, rig), log) == 2


@pytest.mark.parametrize(
    ("hz", "axis", "direction", "where", "cause"),
    [
        (0.3, ACROSS, "across the swing", "across the swing at twice its frequency", "a second support"),
        (0.45, ALONG, "along the swing", "along the swing at three times its frequency", "not linear"),
        (0.15, UP, "along the rope", "along the rope at its frequency", "askew on the rope"),
        (0.025, ALONG, "along the swing", "along the swing at 0.025 Hz", "drifts"),
        (0.375, ACROSS, "across the swing", "across the swing at 0.375 Hz", "a second mode"),
    ],
)
def test_what_is_left_has_a_direction_and_a_frequency(
    rig: TwinRig, hz: float, axis: np.ndarray, direction: str, where: str, cause: str
) -> None:
    found = describe_remainder(recorded(sine(SWING_HZ, 0.05) * ALONG, sine(hz, 2e-3) * axis), rig)

    assert (found.direction, found.where) == (direction, where)
    assert found.share == pytest.approx(0.04, rel=0.1)
    assert found.share_before == pytest.approx(1.0, abs=0.02)
    assert found.amplitude_g == pytest.approx(2e-3, rel=0.1)
    assert cause in found.typical_cause


def test_noise_alone_leaves_nothing_of_the_motion(rig: TwinRig) -> None:
    found = describe_remainder(recorded(sine(SWING_HZ, 0.05) * ALONG, np.zeros(3)), rig)
    assert found.share < 0.01
    assert found.hz is None
    assert found.where.endswith("at no single frequency")
    assert found.typical_cause == ""


def test_what_grows_faster_than_the_swing_is_left_where_it_is_wide(rig: TwinRig) -> None:
    decay = np.exp(-LOG_S / 60)[:, None]
    swing_g, left_g = decay * sine(SWING_HZ, 0.3) * ALONG, decay**3 * sine(3 * SWING_HZ, 0.03) * ALONG
    found = describe_remainder(recorded(swing_g, left_g), rig)
    assert found.share_wide_swing > 2 * found.share_small_swing
    assert "where the swing is wide" in found.sentence


def test_text_and_json_tell_what_is_left(rig: TwinRig) -> None:
    found = describe_remainder(recorded(sine(SWING_HZ, 0.05) * ALONG, sine(0.3, 2e-3) * ACROSS), rig)
    result = made("unmodelled", remainder=found)

    line = next(line for line in to_text(result).splitlines() if line.startswith("left"))

    assert line.startswith(
        "left         4 % of the motion is left (100 % by the nominal model), mostly across the swing"
    )
    assert line.endswith("typical of a second support, a tilted axis, or a sensor askew")
    assert to_json(result, 1.0)["left_of_motion"]["multiple_of_swing"] == 2
    assert "left" not in to_text(made("named", remainder=found))
