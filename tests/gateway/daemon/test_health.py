"""The health message: what keeps a gateway from being healthy, the counters of samples, and the state of a radio."""

import json

import numpy as np
import pytest

from devices.block import RadioStatus, SampleBlock
from gateway.daemon.health import MAX_REPORT_AGE_S, RadioMonitor, SampleCounters, unable_to_alert


@pytest.mark.parametrize(
    ("validity", "swing", "problem"),
    [
        ("valid", None, None),
        ("valid", "trip", None),
        ("uncalibrated", "warn", None),
        ("uncalibrated", "unknown", "the angle is not known: why"),
        ("not_known", "trip", "the angle is not known: why"),
        ("suspended", "unknown", "alerts cannot be raised: why"),
        ("no_samples", "unknown", "alerts cannot be raised: why"),
    ],
)
def test_an_alert_can_be_raised_where_the_angle_is_known_and_alerts_are_not_suspended(
    validity: str, swing: str | None, problem: str | None
) -> None:
    active = [{"rule": "lean", "level": "unknown"}, *([] if swing is None else [{"rule": "swing", "level": swing}])]
    message = {"validity": validity, "active": active, "text": "why"}
    assert unable_to_alert(json.dumps(message).encode()) == problem


def test_before_the_first_message_nothing_is_known() -> None:
    assert unable_to_alert(None) == "no alert message yet"


class SetTime:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def test_nothing_is_known_before_the_first_report() -> None:
    assert RadioMonitor().status() == RadioStatus()


def test_each_quantity_is_kept_until_it_is_stale() -> None:
    now = SetTime()
    monitor = RadioMonitor(now)
    monitor.add(RadioStatus(battery_v=3.9, battery_percent=75.0, battery_low=False, signal_dbm=-60.0))
    now.now_s += MAX_REPORT_AGE_S - 1
    monitor.add(RadioStatus(signal_dbm=-71.0))
    assert monitor.status() == RadioStatus(3.9, 75.0, False, -71.0)
    now.now_s += 2
    assert monitor.status() == RadioStatus(signal_dbm=-71.0)
    now.now_s += MAX_REPORT_AGE_S
    assert monitor.status() == RadioStatus()


def test_a_low_battery_is_one_warning_an_hour(caplog: pytest.LogCaptureFixture) -> None:
    now = SetTime()
    monitor = RadioMonitor(now)
    for low in (False, True, True, None, False, True):
        monitor.add(RadioStatus(battery_v=3.2, battery_low=low))
    said = ("WARNING", "the sensor's battery is low (3.20 V); charge or change it")
    assert [(record.levelname, record.message) for record in caplog.records] == [said]
    now.now_s += 3600
    monitor.add(RadioStatus(battery_v=3.2, battery_low=True))
    assert len(caplog.records) == 2


def test_a_low_battery_without_a_voltage_is_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    RadioMonitor().add(RadioStatus(battery_low=True))
    assert [record.message for record in caplog.records] == ["the sensor's battery is low; charge or change it"]


def test_the_report_of_a_block_is_counted() -> None:
    counters = SampleCounters()
    time_ns = np.array([1], np.int64)
    raw = np.zeros((1, 3), np.int32)
    counters.add(SampleBlock(time_ns, raw, radio=RadioStatus(signal_dbm=-80.0)))
    counters.add(SampleBlock(time_ns, raw))
    assert counters.radio.status() == RadioStatus(signal_dbm=-80.0)
