"""The drift monitor at rest: what it detects, what it stores, and what survives a restart."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.drift.rest_monitor import (
    HOLD_HOURS,
    MAX_DAYS,
    MAX_HOURS,
    NS_PER_HOUR,
    RestDriftMonitor,
    is_at_rest,
)
from gateway.calibration.drift.rest_status import judge_at_rest
from gateway.calibration.record import CalibrationError, CalibrationRecord, content_hash
from gateway.numerics.array import Array
from gateway.stages.condition import MotionContext, judge_condition
from gateway.stages.condition_window import ConditionWindow

CREATED_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""
FIRST_HOUR = CREATED_NS // NS_PER_HOUR
DM_G = 0.005
HANGING: Array = np.array([0.0, 0.0, 1.0])
READINGS_PER_HOUR = 40


def make_record(record_id: str = "r1", u_g: float = 0.0005) -> CalibrationRecord:
    covariance = np.diag(np.concatenate([np.zeros(9), np.full(3, u_g**2)]))
    covariance[[0, 4, 8], [0, 4, 8]] = u_g**2
    content = {
        "format": 1,
        "id": record_id,
        "device_id": "part-7",
        "method": "norm-fit",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "0.1.0",
        "by": "bench",
        "parent": None,
        "unit": "g",
        "offset": [0, 0, 0],
        "correction_matrix": np.eye(3).tolist(),
        "covariance": covariance.tolist(),
        "prediction_interval_g": DM_G,
        "temperature_c": {"mean": 20.0, "min": 15.0, "max": 25.0},
    }
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})


RECORD = make_record()


def correction_by(record: CalibrationRecord) -> Correction:
    info = DeviceInfo(kind="test", device_id="part-7", unit="g", odr_hz=100.0, units_per_g=1.0)
    return correction_for(info, ((0, 1), (1, 1), (2, 1)), record)


def new_monitor(state: Mapping[str, Any] | None = None, record: CalibrationRecord = RECORD) -> RestDriftMonitor:
    return RestDriftMonitor(correction_by(record), state)


def feed_hour(
    monitor: RestDriftMonitor,
    hour: int,
    force_g: ArrayLike,
    temperature_c: float | None = 20.0,
    readings: int = READINGS_PER_HOUR,
) -> None:
    """Feed an hour of rest, counted from the creation of the record."""
    for number in range(readings):
        time_ns = (FIRST_HOUR + hour) * NS_PER_HOUR + number * 500_000_000
        monitor.feed(time_ns, np.asarray(force_g, dtype=float), temperature_c)


def age(
    monitor: RestDriftMonitor,
    rng: np.random.Generator,
    hours: Iterable[int],
    bias_g: float,
    rate_g_per_day: float,
    scatter_g: float = 0.0002,
) -> int | None:
    """Feed hours of a hanging housing with equal readings; return the hour in which the alarm was raised, or None."""
    for hour in hours:
        force_g = HANGING * (1 + bias_g + rate_g_per_day * hour / 24 + rng.normal(0, scatter_g))
        for number in range(30):
            monitor.feed((FIRST_HOUR + int(hour)) * NS_PER_HOUR + number, force_g, 20.0)
        if monitor.alarm_since_hour is not None:
            return int(hour)
    return None


def alarm_hour(monitor: RestDriftMonitor) -> int | None:
    """Return the hour of the alarm; a function, because the type checker takes a property to be constant."""
    return monitor.alarm_since_hour


def test_rest_in_one_pose_shows_one_sum_and_states_which() -> None:
    monitor = new_monitor()
    feed_hour(monitor, 0, [0.003, 0.0, 1.002])
    feed_hour(monitor, 1, HANGING)
    reading = monitor.reading()
    assert reading is not None
    assert reading.norm_error_g == pytest.approx(0.002, abs=1e-5)
    assert reading.direction == pytest.approx((0.003, 0.0, 1.0), abs=1e-4)
    status = judge_at_rest(monitor)
    assert "+0.00 x, +0.00 y, +1.00 z" in status.shows
    assert "not seen" in status.shows
    assert (status.state, status.trend, status.reasons) == ("watching", None, ())


def test_an_offset_across_the_vertical_is_not_detected() -> None:
    monitor = new_monitor()
    for hour in range(10):
        feed_hour(monitor, hour, [0.05, 0.0, 1.0])
    assert monitor.alarm_since_hour is None  # 50 mg, 2.9 degrees: the status states that it is not seen


def test_the_alarm_is_raised_and_cleared_by_hours_that_agree() -> None:
    monitor = new_monitor()
    outside, inside = HANGING * (1 + 1.5 * DM_G), HANGING
    for hour, force_g in enumerate([outside, outside, inside, outside, outside]):
        feed_hour(monitor, hour, force_g)
    feed_hour(monitor, 5, outside)
    assert alarm_hour(monitor) is None
    feed_hour(monitor, 6, inside)
    assert alarm_hour(monitor) == FIRST_HOUR + 3
    status = judge_at_rest(monitor)
    assert status.state == "alarm"
    assert "calibrate" in status.reasons[0]
    for hour in (7, 8, 9):
        assert alarm_hour(monitor) is not None
        feed_hour(monitor, hour, inside)
    assert alarm_hour(monitor) is None


def test_an_hour_with_few_readings_does_not_count() -> None:
    monitor = new_monitor()
    for hour in range(10):
        feed_hour(monitor, hour, HANGING * 1.1, readings=29)
    assert monitor.reading() is None
    assert judge_at_rest(monitor).state == "no_rest"


@pytest.mark.slow
def test_without_ageing_there_is_no_alarm_in_99_of_100_years() -> None:
    """Each simulated sensor has errors of the size of the record's uncertainties."""
    rng = np.random.default_rng(1)
    record = make_record(u_g=0.002)
    u_norm_g = 0.002 * np.sqrt(2)
    alarms = 0
    for _ in range(200):
        monitor = new_monitor(record=record)
        hours = np.sort(rng.choice(365 * 24, 20, replace=False))
        alarms += age(monitor, rng, hours, bias_g=rng.normal(0, u_norm_g), rate_g_per_day=0.0) is not None
    assert alarms <= 2


@pytest.mark.slow
def test_the_alarm_is_raised_soon_after_a_drift_leaves_the_interval() -> None:
    """1 mg a day reaches the interval of 5 mg after 5 days; the hold time adds three hours."""
    rng = np.random.default_rng(2)
    delays_h = []
    for _ in range(12):
        bias_g = rng.normal(0, 0.0007)
        hour = age(new_monitor(), rng, range(24 * 9), bias_g, rate_g_per_day=0.001)
        assert hour is not None
        delays_h.append(hour - 24 * (DM_G - bias_g) / 0.001)
    assert HOLD_HOURS - 2 < np.median(delays_h) < HOLD_HOURS + 8
    assert max(delays_h) < 24


@pytest.mark.slow
def test_the_trend_of_the_magnitude_covers_the_true_rate_with_the_temperature_fitted() -> None:
    rng = np.random.default_rng(3)
    covered, forecast_days = 0, []
    for _ in range(40):
        monitor = new_monitor()
        for day in range(30):
            temperature_c = 20 + 4 * np.sin(day / 4) + rng.normal()
            norm_g = 1 + 5e-5 * day + 1e-4 * (temperature_c - 20) + rng.normal(0, 1e-4)
            for number in range(30):
                monitor.feed((FIRST_HOUR + 24 * day) * NS_PER_HOUR + number, HANGING * norm_g, temperature_c)
        feed_hour(monitor, 24 * 30, HANGING)
        trend = judge_at_rest(monitor).trend
        assert trend is not None
        assert trend.temperature_fitted
        low, high = trend.rate95_mg_per_day
        covered += low <= 0.05 <= high
        forecast_days.append(trend.limit_in_days)
    assert covered >= 35
    assert (
        30 < np.median([days for days in forecast_days if days is not None]) < 75
    )  # 5 mg at 0.05 mg per day, after 30 days


def test_a_temperature_outside_the_calibrations_range_is_reported() -> None:
    monitor = new_monitor()
    feed_hour(monitor, 0, HANGING, temperature_c=38.0)
    feed_hour(monitor, 1, HANGING)
    assert "38 °C is outside the calibration's 15 to 25 °C" in judge_at_rest(monitor).reasons[0]


def test_a_restart_continues_where_it_was() -> None:
    rng = np.random.default_rng(4)
    straight, restarted = new_monitor(), new_monitor()
    for hour in range(60):
        force_g = HANGING + rng.normal(0, 0.001, 3) + (0.02 if hour > 50 else 0)
        for monitor in (straight, restarted):
            feed_hour(monitor, hour, force_g)
        if hour % 7 == 0:
            restarted = new_monitor(json.loads(json.dumps(restarted.state())))
    assert restarted.state() == straight.state()
    assert restarted.alarm_since_hour == straight.alarm_since_hour is not None


@pytest.mark.parametrize("state", [{}, {"format": 1, "hours": "x"}, {"calibration_id": "r1", "hours": [{"hour": 1}]}])
def test_an_unreadable_state_is_replaced_by_a_new_one(state: dict[str, Any]) -> None:
    assert new_monitor(state).reading() is None


def test_another_record_has_a_new_state() -> None:
    monitor = new_monitor()
    for hour in range(10):
        feed_hour(monitor, hour, HANGING * 1.1)
    assert monitor.alarm_since_hour is not None
    later = new_monitor(monitor.state(), make_record("r2"))
    assert later.alarm_since_hour is None
    assert later.reading() is None


@pytest.mark.slow
def test_memory_is_bounded() -> None:
    monitor = new_monitor()
    for hour in range(0, 24 * (MAX_DAYS + 30), 6):
        feed_hour(monitor, hour, HANGING * 1.000123456789, temperature_c=20.123456789, readings=30)
    state = monitor.state()
    assert (len(state["hours"]), len(state["days"])) == (MAX_HOURS, MAX_DAYS)
    assert len(json.dumps(state)) < 120_000


def test_readings_of_a_wrong_clock_are_ignored() -> None:
    monitor = new_monitor()
    for number in range(100):
        monitor.feed(number * 10**9, HANGING, None)  # 1970
    assert (monitor.misdated, monitor.reading()) == (100, None)
    for hour in range(5):
        feed_hour(monitor, hour, HANGING)
    for hour in range(24 * 3650, 24 * 3650 + 5):  # ten years ahead
        feed_hour(monitor, hour, HANGING)
    for hour in range(5, 8):
        feed_hour(monitor, hour, HANGING)
    hours = [mean["hour"] - FIRST_HOUR for mean in monitor.state()["hours"]]
    assert hours == [0, 1, 2, 3, 4, 5, 6]
    assert "the clock was wrong" in judge_at_rest(monitor).reasons[-1]


def test_a_device_without_a_record_cannot_be_monitored() -> None:
    info = DeviceInfo(kind="test", device_id="part-7", unit="g", odr_hz=100.0, units_per_g=1.0)
    with pytest.raises(CalibrationError, match="needs a calibration record"):
        RestDriftMonitor(correction_for(info, ((0, 1), (1, 1), (2, 1)), None))


def test_the_verdict_static_would_hide_a_drift_and_the_gates_of_stillness_do_not() -> None:
    """The monitor depends on `still` and `steady`, because a magnitude that has drifted is no longer `static`."""
    rng = np.random.default_rng(7)
    window = ConditionWindow()
    for block in range(80):
        time_s = np.asarray(block * 0.1 + np.arange(10) * 0.01, dtype=np.float64)
        force_g: Array = HANGING * (1 + 2 * DM_G) + rng.normal(0, 0.0005, (10, 3))
        window.update(time_s, force_g, clipped=0, missing=0)
    swing = MotionContext(state="rest", u_rad=0.001)
    found = judge_condition(window, swing, 0.0005, DM_G)
    assert found.verdict != "static"
    assert is_at_rest(found.gates)
    assert not is_at_rest(found.gates | {"steady": False})
    assert not is_at_rest({"enough_data": False})
