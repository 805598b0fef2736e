"""The drift watch in the pipeline: fed at rest alone, and its alarm told as a warning of its own."""

from collections import defaultdict
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import correction_for
from gateway.calibration.drift.rest_monitor import HOLD_HOURS, NS_PER_HOUR, RestDriftMonitor
from gateway.calibration.record import CalibrationRecord, content_hash
from gateway.configuration.loading import validate
from gateway.messages import CALIBRATION_RULE, NO_SESSION, ActiveAlert, Alert
from gateway.pipeline.drift_monitor import DRIFTED, DriftMonitor
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker
from gateway.pipeline.pipeline import Pipeline
from tests.values import present

RATE_HZ, BLOCK = 50.0, 10
MADE_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""
DM_G, NOISE_G = 0.005, 0.0005
INFO = DeviceInfo(kind="test", device_id="part-7", unit="g", odr_hz=RATE_HZ, units_per_g=1.0, noise_g=NOISE_G)
AXES = ((0, 1), (1, 1), (2, 1))


def make_record() -> CalibrationRecord:
    covariance = np.diag([1e-8] * 12)
    content = {
        "format": 1,
        "id": "r1",
        "device_id": INFO.device_id,
        "method": "norm-fit",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "test",
        "by": "bench",
        "parent": None,
        "unit": "g",
        "offset": [0, 0, 0],
        "correction_matrix": np.eye(3).tolist(),
        "covariance": covariance.tolist(),
        "prediction_interval_g": DM_G,
        "temperature_c": None,
    }
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})


CORRECTION = correction_for(INFO, AXES, make_record())


class Hanging:
    """A pipeline over a housing that hangs still, some seconds of each hour."""

    def __init__(self, wall_offset_ns: int = 0) -> None:
        self.rest = DriftMonitor(RestDriftMonitor(CORRECTION))
        self.clock = ClockState("synchronised", wall_offset_ns)
        self.open()
        self.out: defaultdict[str, list[Any]] = defaultdict(list)
        self._random = np.random.default_rng(5)

    def open(self) -> None:
        configuration = validate({"housing": {"position_m": 5.0}, "rope": {"length_m": 8.0}}, "test")
        self.pipeline = Pipeline(configuration, INFO, CORRECTION, HeaderMaker(), drift=self.rest)

    def hour(self, hour: int, error_g: float = 0.0, seconds: float = 20.0, sway_g: float = 0.0) -> "Hanging":
        for number in range(round(seconds * RATE_HZ / BLOCK)):
            at_s = (number * BLOCK + np.arange(BLOCK)) / RATE_HZ
            force_g = np.tile([0.0, 0.0, 1.0 + error_g], (BLOCK, 1))
            force_g[:, 0] += sway_g * np.sin(2 * np.pi * at_s / 5.7)
            raw = force_g + self._random.normal(0, NOISE_G, (BLOCK, 3))
            time_ns = MADE_NS + hour * NS_PER_HOUR + np.rint(at_s * 1e9).astype(np.int64)
            block = SampleBlock(time_ns=time_ns, raw=raw, temperature_c=20.0 if number == 0 else None)
            for emission in self.pipeline.process(block, self.clock).messages:
                self.out[emission.topic].append(emission.message)
        return self

    @property
    def alert(self) -> Alert:
        alert: Alert = self.out["alert"][-1]
        return alert


def calibration_of(alert: Alert) -> ActiveAlert | None:
    return next((one for one in alert.active if one.rule == "calibration"), None)


@pytest.fixture(scope="module")
def after_drift() -> Hanging:
    """A crane whose sensor has drifted for as long as the warning takes; each test goes on from a copy of it."""
    crane = Hanging()
    for hour in range(HOLD_HOURS):
        crane.hour(hour, error_g=2 * DM_G)
        assert calibration_of(crane.alert) is None
    return crane.hour(HOLD_HOURS, error_g=2 * DM_G)


@pytest.mark.slow
def test_drift_beyond_the_interval_raises_a_warning_without_a_static_verdict(after_drift: Hanging) -> None:
    crane = after_drift
    assert "static" not in {condition.verdict for condition in crane.out["condition"]}
    warned = present(calibration_of(crane.alert))
    assert warned.level == "warn"
    assert "deviates from 1 g" in warned.text
    assert "calibrate" in warned.text
    raised = [alert for alert in crane.out["alert"] if alert.rule == "calibration"]
    assert [alert.event for alert in raised] == ["raised"]
    assert present(crane.rest.status_json)["state"] == "alarm"
    assert present(crane.rest.status_json)["norm_error_mg"] == pytest.approx(2000 * DM_G, rel=0.05)


@pytest.mark.slow
def test_the_drift_warning_clears_with_the_drift_and_not_with_a_swing(after_drift: Hanging) -> None:
    crane = deepcopy(after_drift)
    assert calibration_of(crane.alert) is not None
    for hour in range(HOLD_HOURS + 1, 2 * HOLD_HOURS + 2):
        crane.hour(hour, sway_g=0.05)
    assert calibration_of(crane.alert) is not None
    for hour in range(2 * HOLD_HOURS + 2, 3 * HOLD_HOURS + 4):
        crane.hour(hour)
    assert calibration_of(crane.alert) is None
    raised = [alert.event for alert in crane.out["alert"] if alert.rule == "calibration"]
    assert raised == ["raised", "cleared"]


@pytest.mark.slow
def test_drift_within_the_interval_raises_no_warning() -> None:
    crane = Hanging()
    assert present(crane.rest.status_json)["state"] == "no_rest"
    for hour in range(HOLD_HOURS + 1):
        crane.hour(hour, error_g=DM_G / 2)
    assert present(crane.rest.status_json)["state"] == "watching"
    assert crane.rest.alarm is None
    assert CALIBRATION_RULE not in {alert.rule for alert in crane.out["alert"]}


@pytest.mark.slow
def test_the_drift_monitor_gets_no_readings_off_the_rope() -> None:
    crane = Hanging()
    crane.pipeline.set_session(replace(NO_SESSION, phase="collecting", suspended=True))
    crane.hour(0).hour(1)
    assert not crane.rest.has_unsaved_readings
    crane.pipeline.set_session(NO_SESSION)
    crane.hour(2)
    assert crane.rest.has_unsaved_readings


@pytest.mark.slow
def test_the_drift_warning_is_unknown_while_alerts_are_suspended(after_drift: Hanging) -> None:
    crane = deepcopy(after_drift)
    crane.pipeline.set_session(replace(NO_SESSION, phase="collecting", suspended=True))
    crane.hour(HOLD_HOURS + 2, seconds=2)
    assert crane.alert.level == "unknown"
    assert "SUSPENDED" in present(calibration_of(crane.alert)).text
    crane.open()
    crane.hour(HOLD_HOURS + 3, error_g=2 * DM_G, seconds=2)
    assert present(calibration_of(crane.alert)).level == "warn"


@pytest.mark.slow
def test_drift_readings_have_the_time_of_the_wall_clock() -> None:
    ahead = Hanging(2 * NS_PER_HOUR).hour(0)
    assert present(ahead.rest.dump_state())["open"]["hour"] == MADE_NS // NS_PER_HOUR + 2
    behind = Hanging(-NS_PER_HOUR).hour(0)
    assert present(behind.rest.dump_state())["open"] is None
    assert present(behind.rest.dump_state())["misdated"] > 0


@pytest.mark.slow
def test_drift_readings_have_the_temperature_of_a_part_that_tells_it_rarely() -> None:
    assert present(Hanging().hour(0).rest.dump_state())["open"]["temperature_c"] > 0  # the sum of the hour


def test_a_drift_alarm_without_its_hours_states_what_to_do() -> None:
    state = RestDriftMonitor(CORRECTION).state() | {"alarm_since_hour": MADE_NS // NS_PER_HOUR}
    assert DriftMonitor(RestDriftMonitor(CORRECTION, state)).alarm == DRIFTED


def test_without_a_record_there_is_no_drift() -> None:
    rest = DriftMonitor(None)
    rest.update({}, MADE_NS, np.array([0.0, 0.0, 1.0]), None)
    assert (rest.status_json, rest.alarm, rest.calibration_id, rest.dump_state()) == (None, None, None, None)
