"""Errors that grow with temperature, planted: the interval of swing and lean holds, and the reason names the temperature."""

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import Crane
from gateway.calibration.correction import Correction
from gateway.configuration.loading import validate
from gateway.messages import Swing, Tilt
from gateway.pipeline.alert_rules import Evaluation, lean_reading
from gateway.pipeline.motion_stage import MotionStage
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, MessageTime
from gateway.pipeline.pipeline import Pipeline
from tests.values import present

RATE_HZ, NOISE_G, WARMER_K = 50.0, 2e-4, 40.0
OFFSET_G_PER_K, SCALE_PER_K = 0.15e-3, 1e-4
INFO = DeviceInfo(kind="test", device_id="t", unit="g", odr_hz=RATE_HZ, units_per_g=1.0, noise_g=NOISE_G)
CORRECTION = Correction(
    status="calibrated",
    calibration_id="r1",
    gain=np.eye(3),
    bias_g=np.zeros(3),
    u_zero_g_offset_g=np.full(3, 1e-4),
    u_scale_factor=np.full(3, 1e-4),
    permissible_norm_error_g=0.002,
    text="r1",
    calibrated_c=(20.0, 24.0),
    u_zero_g_offset_g_per_k=OFFSET_G_PER_K / np.sqrt(3),
    u_scale_factor_per_k=SCALE_PER_K / np.sqrt(3),
)


@pytest.fixture(scope="module")
def crane() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """True specific force in g of a swing of 6 degrees without a lean, and its times."""
    time_s = np.arange(round(35 * RATE_HZ)) / RATE_HZ
    crane = Crane(length_m=9.0, position_m=2.7, motion=start_motion(np.radians(6.0), 0.0, 0.0, 0.0))
    return time_s, crane.specific_force_m_s2(time_s) / STANDARD_GRAVITY_M_S2


def last_word(crane: tuple[NDArray[np.float64], NDArray[np.float64]], temperature_c: float) -> tuple[Swing, float]:
    """Last message and upper end of the lean, of a part that is `WARMER_K` too warm, with its datasheet's errors planted."""
    time_s, force_g = crane
    planted_g = force_g * (1 + WARMER_K * SCALE_PER_K) + np.array([1.0, 0.5, -0.5]) * WARMER_K * OFFSET_G_PER_K
    planted_g = planted_g + NOISE_G * np.random.default_rng(4).normal(size=force_g.shape)
    table = {"rope": {"length_m": 9.3}, "housing": {"position_m": 2.7}, "device": {"odr_hz": RATE_HZ}}
    stage = MotionStage(validate(table, "test"), INFO, CORRECTION)
    for begin in range(0, len(time_s), 10):
        part = slice(begin, begin + 10)
        stage.update(time_s[part], planted_g[part], planted_g[part], temperature_c=temperature_c)
    header = HeaderMaker().make("swing", MessageTime(0, ClockState("synchronised", 0)), "r1")
    return stage.swing_message(header), present(
        lean_reading(Evaluation(stage.estimate, None, is_calibrated=True))
    ).upper_rad


@pytest.mark.slow
def test_uncertainty_covers_swing_and_lean_outside_the_calibrated_temperature_range(
    crane: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    message, lean_end_rad = last_word(crane, 24.0 + WARMER_K)

    low_deg, high_deg = present(message.coverage95_deg)
    assert low_deg < 6.0 < high_deg
    assert np.degrees(lean_end_rad) > 2 * present(message.lean_deg)  # no lean is as likely: the truth is none
    assert "widened: at 64 °C, calibrated at 20 to 24 °C" in message.reasons


@pytest.mark.slow
def test_uncertainty_is_unchanged_within_the_calibrated_temperature_range(
    crane: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    message, lean_end_rad = last_word(crane, 23.0)

    assert np.degrees(lean_end_rad) < 1.5 * present(message.lean_deg)
    assert not any("°C" in reason for reason in message.reasons)


def last_tilt(temperatures_c: list[float | None]) -> Tilt:
    """The last tilt of a housing at rest, its part telling these temperatures, one a block."""
    table = {"rope": {"length_m": 9.3}, "housing": {"position_m": 2.7}, "device": {"odr_hz": RATE_HZ}}
    pipeline = Pipeline(validate(table, "test"), INFO, CORRECTION, HeaderMaker())
    tilts = []
    for number, temperature_c in enumerate(temperatures_c):
        time_ns = np.rint((number * 10 + np.arange(10)) / RATE_HZ * 1e9).astype(np.int64)
        block = SampleBlock(time_ns, np.tile([0.0, 0.0, 1.0], (10, 1)), temperature_c)
        emissions = pipeline.process(block, ClockState("synchronised", 0)).messages
        tilts += [emission.message for emission in emissions if isinstance(emission.message, Tilt)]
    return tilts[-1]


def test_the_tilt_uncertainty_follows_the_newest_temperature() -> None:
    cool = present(last_tilt([23.0] * 10).u_deg)
    assert present(last_tilt([23.0] * 5 + [24.0 + WARMER_K] + [None] * 4).u_deg) > 5 * cool
    assert last_tilt([*[24.0 + WARMER_K] * 5, *[23.0] * 5]).u_deg == cool


def test_the_tilt_states_the_newest_temperature_of_a_part_that_tells_it_rarely() -> None:
    assert last_tilt([23.0] + [None] * 9).temperature_c == 23.0
