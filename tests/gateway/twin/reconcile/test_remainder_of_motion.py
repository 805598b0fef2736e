"""What is left of a motion, planted: how much, in which direction of the swing, at which multiple of its frequency."""

import numpy as np
import pytest

from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Curves
from gateway.twin.reconcile.output.serialisation import to_json
from gateway.twin.reconcile.output.text import to_text
from gateway.twin.reconcile.residual.remainder_of_motion import (
    describe_remainder,
    multiple_of_swing,
    swing_frequency_hz,
)
from tests.gateway.twin.report.conftest import made

SWING_HZ = 0.15
"""The rope of the rig would swing at 0.13 Hz."""
NOISE_G = 1e-3
TIME_S = np.arange(0, 120, 0.04)
AZIMUTH_RAD = 0.5
ALONG, ACROSS = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (AZIMUTH_RAD, AZIMUTH_RAD + np.pi / 2))
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def rig() -> TwinRig:
    return made("unmodelled").rig


def sine(hz: float, amplitude_g: float) -> np.ndarray:
    wave: np.ndarray = amplitude_g * np.sin(2 * np.pi * hz * TIME_S)[:, None]
    return wave


def recorded(swing_g: np.ndarray, left_g: np.ndarray) -> Curves:
    """The nominal model simulates nothing that swings; the final one all but what is left."""
    noise_g = NOISE_G * np.random.default_rng(2).normal(size=(len(TIME_S), 3))
    still, used = np.zeros_like(noise_g), np.ones(len(TIME_S), dtype=bool)
    return Curves(TIME_S, swing_g + left_g + noise_g, still, swing_g, used, np.full(3, NOISE_G))


@pytest.mark.parametrize(
    ("hz", "multiple"), [(0.15, 1), (0.302, 2), (0.445, 3), (0.6, 4), (0.75, None), (0.335, None), (0.05, None)]
)
def test_a_line_is_at_a_multiple_of_what_the_load_swings_at(rig: TwinRig, hz: float, multiple: int | None) -> None:
    log = recorded(sine(SWING_HZ, 0.05) * ALONG, np.zeros(3))
    assert multiple_of_swing(hz, swing_frequency_hz(log, rig), log) == multiple


def test_near_the_load_where_nothing_swings_across_the_rig_tells_the_frequency(rig: TwinRig) -> None:
    log = recorded(0 * TIME_S[:, None] * UP, np.zeros(3))
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
    decay = np.exp(-TIME_S / 60)[:, None]
    swing_g, left_g = decay * sine(SWING_HZ, 0.3) * ALONG, decay**3 * sine(3 * SWING_HZ, 0.03) * ALONG
    found = describe_remainder(recorded(swing_g, left_g), rig)
    assert found.share_wide > 2 * found.share_small
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
