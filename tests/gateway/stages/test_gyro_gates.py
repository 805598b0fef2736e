"""What angular rates add to the condition: forces alone do not show a housing that turns about a rope at rest."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.stages.condition import ConditionResult, MotionContext, judge_condition
from gateway.stages.condition_window import ConditionWindow

RATE_HZ, NOISE_G, DM_G, PERIOD_S = 100.0, 0.0004, 0.002, 6.0
PHI_MAX_RAD, RHO = math.radians(8), 0.3
TIME_S = np.arange(400) / RATE_HZ
STILL = MotionContext(state="rest", u_rad=0.001, phi_max_rad=0.001)
SWINGING = MotionContext(state="free", u_rad=0.001, phi_max_rad=PHI_MAX_RAD, rho=RHO, period_s=PERIOD_S)


def judged(force_g: NDArray[np.float64], rate_dps: NDArray[np.float64] | None, seen: MotionContext) -> ConditionResult:
    window = ConditionWindow()
    rate_rad_s = None if rate_dps is None else np.radians(rate_dps)
    for begin in range(0, len(TIME_S), 10):
        part = slice(begin, begin + 10)
        window.update(TIME_S[part], force_g[part], 0, 0, None if rate_rad_s is None else rate_rad_s[part])
    return judge_condition(window, seen, NOISE_G, DM_G)


def rest() -> NDArray[np.float64]:
    return np.random.default_rng(0).normal((0.0, 0.0, 1.0), NOISE_G, (len(TIME_S), 3))


def swing() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Specific force and angular rate in degrees per second of a planar swing along x, which turns about y."""
    phase = 2 * math.pi * TIME_S / PERIOD_S
    phi, force_g = PHI_MAX_RAD * np.cos(phase), rest()
    force_g[:, 0] += (1 - RHO) * np.sin(phi)
    force_g[:, 2] += np.cos(phi) - 1 + 2 * RHO * (np.cos(phi) - math.cos(PHI_MAX_RAD))
    rate_dps = np.zeros_like(force_g)
    rate_dps[:, 1] = np.degrees(PHI_MAX_RAD * 2 * math.pi / PERIOD_S * np.sin(phase))
    return force_g, rate_dps


def turning(about: int, rate_dps: float) -> NDArray[np.float64]:
    rates = np.random.default_rng(1).normal(0.0, 0.1, (len(TIME_S), 3))
    rates[:, about] += rate_dps
    return rates


def test_without_a_gyroscope_there_are_no_rotation_gates() -> None:
    assert not {"not_turning", "no_spin", "rate_pendulum"} & judged(rest(), None, STILL).gates.keys()


def test_rest_with_a_quiet_gyroscope_is_static() -> None:
    found = judged(rest(), turning(2, 0.8), STILL)
    assert found.verdict == "static"
    assert found.gates["not_turning"]


@pytest.mark.parametrize("about", [0, 1, 2])
def test_a_rotating_housing_is_not_static(about: int) -> None:
    """About the rope no accelerometer on it can see this."""
    assert judged(rest(), None, STILL).verdict == "static"
    found = judged(rest(), turning(about, 10.0), STILL)
    assert (found.verdict, found.trusted) == ("disturbed", False)
    assert any("turns" in reason for reason in found.reasons)


def test_a_free_swing_passes_the_rotation_gates() -> None:
    found = judged(*swing(), SWINGING)
    assert found.verdict == "swinging"
    assert found.gates["rate_pendulum"]
    assert found.gates["no_spin"]


@pytest.mark.parametrize(("extra_dps", "gate"), [((0.0, 15.0, 0.0), "rate_pendulum"), ((0.0, 0.0, 8.0), "no_spin")])
def test_a_swing_with_a_rotating_housing_is_disturbed(extra_dps: tuple[float, float, float], gate: str) -> None:
    force_g, rate_dps = swing()
    found = judged(force_g, rate_dps + extra_dps, SWINGING)
    assert found.verdict == "disturbed"
    assert not found.gates[gate]


def test_a_drive_is_not_held_to_the_rates_of_a_free_swing() -> None:
    force_g, rate_dps = swing()
    driven = MotionContext(state="driven", u_rad=0.001, phi_max_rad=PHI_MAX_RAD, rho=RHO, period_s=PERIOD_S)
    found = judged(force_g, rate_dps + np.array([0.0, 15.0, 0.0]), driven)
    assert found.verdict == "driven"
    assert "rate_pendulum" not in found.gates


def test_angular_rates_that_are_not_finite_are_left_out() -> None:
    rate_dps = turning(2, 0.0)
    rate_dps[::3] = np.nan
    assert judged(rest(), rate_dps, STILL).verdict == "static"
    assert "not_turning" not in judged(rest(), np.full((len(TIME_S), 3), np.nan), STILL).gates
