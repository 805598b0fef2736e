"""Modes of a double pendulum, their inverse and its derivatives; the period of small and large swings."""

import math

import pytest
from scipy.special import ellipk

from devices.pendulum.double_pendulum import hook_mass_ratio, modes
from devices.pendulum.small_swing import (
    STANDARD_GRAVITY_M_S2,
    normal_gravity_m_s2,
    period_ratio,
    small_swing_length_m,
    small_swing_period_s,
    small_swing_rate_1_s,
)

G = STANDARD_GRAVITY_M_S2
TOTAL_M = 10.0


@pytest.mark.parametrize("rigging_m", [1.0, 4.0, 8.0])
@pytest.mark.parametrize("ratio", [0.02, 0.2, 2.0])
def test_hook_mass_ratio_is_the_inverse_of_the_fast_mode(rigging_m: float, ratio: float) -> None:
    _, fast = modes(TOTAL_M - rigging_m, rigging_m, ratio, G)

    assert hook_mass_ratio(TOTAL_M - rigging_m, rigging_m, fast.rate, G) == pytest.approx(ratio, rel=1e-9)


def test_no_hook_gives_a_mode_slower_than_its_shorter_pendulum() -> None:
    slowest_1_s = small_swing_rate_1_s(2.0, G)

    assert hook_mass_ratio(8.0, 2.0, 0.99 * slowest_1_s, G) == math.inf


def test_a_light_hook_leaves_the_slow_mode_of_one_pendulum() -> None:
    slow, _ = modes(7.0, 3.0, 1e-7, G)

    assert slow.rate == pytest.approx(small_swing_rate_1_s(TOTAL_M, G), rel=1e-5)
    assert slow.rigging_tilt == pytest.approx(1.0, rel=1e-5)


def test_period_rate_and_length_of_a_small_swing_belong_together() -> None:
    rate_1_s = small_swing_rate_1_s(TOTAL_M, G)

    assert small_swing_period_s(TOTAL_M, G) == pytest.approx(2 * math.pi / rate_1_s)
    assert small_swing_length_m(rate_1_s, G) == pytest.approx(TOTAL_M)


@pytest.mark.parametrize(("amplitude_deg", "ratio"), [(0, 1.0), (30, 1.01740880), (90, 1.18034060), (150, 1.76220373)])
def test_period_ratio_is_the_complete_elliptic_integral(amplitude_deg: float, ratio: float) -> None:
    assert 2 / math.pi * ellipk(math.sin(math.radians(amplitude_deg) / 2) ** 2) == pytest.approx(ratio, rel=1e-8)
    assert period_ratio(math.radians(amplitude_deg)) == pytest.approx(ratio, rel=1e-8)


def test_period_ratio_has_a_value_at_180_degrees() -> None:
    assert 3.3 < period_ratio(math.pi) < 3.9


def test_normal_gravity_at_the_equator_and_in_warsaw() -> None:
    assert normal_gravity_m_s2(0.0, 0.0) == pytest.approx(9.78033, abs=1e-5)
    assert normal_gravity_m_s2(52.23, 100.0) == pytest.approx(9.8123, abs=5e-4)
