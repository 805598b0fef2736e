"""The demonstration, as it runs without a configuration: the alert levels and the log tell its story."""

import logging

import numpy as np
import pytest

from devices.simulated.device import SimulatedCrane
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import validate
from gateway.daemon.sampling.device_factory import make_device
from gateway.messages import Alert
from gateway.pipeline.outgoing_message import HeaderMaker
from gateway.pipeline.pipeline import Pipeline
from tests.clocks import SleeplessClock
from tests.gateway.pipeline.test_pipeline import CLOCK

TRIP_DEG = 6.0
ROUND_S = 110.0
CALM_S = 25.0
STORY = ["unknown", "normal", "warn", "trip", "warn", "normal"]
CAPTIONS = [
    "Trolley starts hastily",
    "Operator catches the swing",
    "Lowering 3 m",
    "Hoisting 3 m",
    "Gust of wind",
    "Another gust",
]


@pytest.mark.slow
def test_the_demonstration_is_calm_then_trips_before_the_limit_then_clears(caplog: pytest.LogCaptureFixture) -> None:
    clock, configuration = SleeplessClock(), validate({}, "test")
    start_ns = clock.now_ns()
    device = make_device(configuration, clock)
    assert isinstance(device, SimulatedCrane)
    info = device.open()
    pipeline = Pipeline(configuration, info, correction_for(info, configuration.device.axes, None), HeaderMaker())
    alerts: list[tuple[float, Alert]] = []
    angles: list[tuple[float, float]] = []
    with caplog.at_level(logging.INFO, "plumbline.device"):
        while clock.now_ns() - start_ns < ROUND_S * 1e9:
            block = device.read()
            assert block is not None
            time_s = (int(block.time_ns[-1]) - start_ns) / 1e9
            angles.append((time_s, np.degrees(device.truth(block.time_ns[-1:]).rope_angle_rad[0])))
            out = pipeline.process(block, CLOCK).messages
            alerts += [(time_s, each.message) for each in out if isinstance(each.message, Alert)]

    changes = [
        new for old, new in zip([None, *alerts], alerts, strict=False) if not old or old[1].level != new[1].level
    ]
    assert [alert.level for _, alert in changes] == STORY
    known_s, warned_s, tripped_s, _, cleared_s = (time_s for time_s, _ in changes[1:])
    assert known_s < 0.03 * 180  # known 97 % of three minutes
    assert max(angle_deg for time_s, angle_deg in angles if time_s < warned_s) < 2.0
    assert warned_s > CALM_S
    exceeded_s = min(time_s for time_s, angle_deg in angles if angle_deg > TRIP_DEG)
    assert exceeded_s - tripped_s > 1.0
    assert cleared_s < 60.0
    assert [record.getMessage().removeprefix("simulated crane: ") for record in caplog.records] == CAPTIONS
