"""The drift watch at rest: what it sees, what it holds, what survives a restart."""

import json

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.drift.rest_monitor import (
    DAYS_KEPT,
    HOLD_HOURS,
    HOURS_KEPT,
    NS_PER_HOUR,
    RestDriftMonitor,
    at_rest,
)
from gateway.calibration.drift.rest_status import rest_status
from gateway.calibration.record import CalibrationError, CalibrationRecord, content_hash
from gateway.stages.conditions.monitor import ConditionMonitor, SwingContext

MADE_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""
FIRST_HOUR = MADE_NS // NS_PER_HOUR
DM_G = 0.005
HANGING = np.array([0.0, 0.0, 1.0])
READINGS = 40
"""At rest in each simulated hour."""


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


def new_watch(state=None, record: CalibrationRecord = RECORD) -> RestDriftMonitor:
    return RestDriftMonitor(correction_by(record), state)


def feed_hour(
    watch: RestDriftMonitor, hour: int, force_g, temperature_c: float | None = 20.0, readings: int = READINGS
) -> None:
    """An hour of rest, counted from when the record was made."""
    for number in range(readings):
        time_ns = (FIRST_HOUR + hour) * NS_PER_HOUR + number * 500_000_000
        watch.feed(time_ns, np.asarray(force_g, dtype=float), temperature_c)


def aged(watch: RestDriftMonitor, rng, hours, bias_g: float, per_day_g: float, wander_g: float = 0.0002) -> int | None:
    """Feed hours of a hanging housing; the hour in which the alarm was raised. One reading stands for the hour's mean."""
    for hour in hours:
        force_g = HANGING * (1 + bias_g + per_day_g * hour / 24 + rng.normal(0, wander_g))
        for number in range(30):
            watch.feed((FIRST_HOUR + int(hour)) * NS_PER_HOUR + number, force_g, 20.0)
        if watch.alarm_since_hour is not None:
            return int(hour)
    return None


def test_rest_in_one_pose_shows_one_sum_and_says_which() -> None:
    watch = new_watch()
    feed_hour(watch, 0, [0.003, 0.0, 1.002])
    feed_hour(watch, 1, HANGING)
    reading = watch.reading()
    assert reading is not None
    assert reading.norm_error_g == pytest.approx(0.002, abs=1e-5)
    assert reading.direction == pytest.approx((0.003, 0.0, 1.0), abs=1e-4)
    status = rest_status(watch)
    assert "+0.00 x, +0.00 y, +1.00 z" in status.shows
    assert "not seen" in status.shows
    assert (status.state, status.trend, status.reasons) == ("watching", None, ())


def test_an_offset_across_the_vertical_does_not_show() -> None:
    watch = new_watch()
    for hour in range(10):
        feed_hour(watch, hour, [0.05, 0.0, 1.0])
    assert watch.alarm_since_hour is None  # 50 mg, 2.9 degrees: the status says that it is blind to this


def test_the_alarm_needs_hours_that_agree_and_clears_the_same_way() -> None:
    watch = new_watch()
    outside, inside = HANGING * (1 + 1.5 * DM_G), HANGING
    for hour, force_g in enumerate([outside, outside, inside, outside, outside]):
        feed_hour(watch, hour, force_g)
    feed_hour(watch, 5, outside)
    assert watch.alarm_since_hour is None
    feed_hour(watch, 6, inside)
    assert watch.alarm_since_hour == FIRST_HOUR + 3
    status = rest_status(watch)
    assert status.state == "alarm"
    assert "calibrate" in status.reasons[0]
    for hour in (7, 8, 9):
        assert watch.alarm_since_hour is not None
        feed_hour(watch, hour, inside)
    assert watch.alarm_since_hour is None


def test_a_few_readings_make_no_hour() -> None:
    watch = new_watch()
    for hour in range(10):
        feed_hour(watch, hour, HANGING * 1.1, readings=29)
    assert watch.reading() is None
    assert rest_status(watch).state == "no_rest"


@pytest.mark.slow
def test_no_alarm_without_ageing_in_99_of_100_years() -> None:
    """A record whose interval only just holds what its own uncertainties allow; each simulated sensor is wrong by those."""
    rng = np.random.default_rng(1)
    record = make_record(u_g=0.002)
    u_norm_g = 0.002 * np.sqrt(2)
    alarms = 0
    for _ in range(200):
        watch = new_watch(record=record)
        hours = np.sort(rng.choice(365 * 24, 20, replace=False))
        alarms += aged(watch, rng, hours, bias_g=rng.normal(0, u_norm_g), per_day_g=0.0) is not None
    assert alarms <= 2


@pytest.mark.slow
def test_time_to_alarm_of_a_planted_drift() -> None:
    """1 mg a day reaches the interval of 5 mg after 5 days; the hold takes three hours more."""
    rng = np.random.default_rng(2)
    delays_h = []
    for _ in range(12):
        bias_g = rng.normal(0, 0.0007)
        hour = aged(new_watch(), rng, range(24 * 9), bias_g, per_day_g=0.001)
        assert hour is not None
        delays_h.append(hour - 24 * (DM_G - bias_g) / 0.001)
    assert HOLD_HOURS - 2 < np.median(delays_h) < HOLD_HOURS + 8
    assert max(delays_h) < 24


@pytest.mark.slow
def test_the_trend_of_the_norm_covers_what_was_planted_with_the_temperature_beside_it() -> None:
    rng = np.random.default_rng(3)
    covered, told = 0, []
    for _ in range(40):
        watch = new_watch()
        for day in range(30):
            warm_c = 20 + 4 * np.sin(day / 4) + rng.normal()
            norm_g = 1 + 5e-5 * day + 1e-4 * (warm_c - 20) + rng.normal(0, 1e-4)
            for number in range(30):
                watch.feed((FIRST_HOUR + 24 * day) * NS_PER_HOUR + number, HANGING * norm_g, warm_c)
        feed_hour(watch, 24 * 30, HANGING)
        trend = rest_status(watch).trend
        assert trend is not None
        assert trend.temperature_fitted
        low, high = trend.rate95_mg_per_day
        covered += low <= 0.05 <= high
        told.append(trend.limit_in_days)
    assert covered >= 35
    assert (
        30 < np.median([days for days in told if days is not None]) < 75
    )  # 5 mg at 0.05 mg a day, 30 days of it are over


def test_warmth_outside_the_calibrations_range_is_said() -> None:
    watch = new_watch()
    feed_hour(watch, 0, HANGING, temperature_c=38.0)
    feed_hour(watch, 1, HANGING)
    assert "38 °C is outside the calibration's 15 to 25 °C" in rest_status(watch).reasons[0]


def test_a_restart_goes_on_where_it_was() -> None:
    rng = np.random.default_rng(4)
    straight, restarted = new_watch(), new_watch()
    for hour in range(60):
        force_g = HANGING + rng.normal(0, 0.001, 3) + (0.02 if hour > 50 else 0)
        for watch in (straight, restarted):
            feed_hour(watch, hour, force_g)
        if hour % 7 == 0:
            restarted = new_watch(json.loads(json.dumps(restarted.state())))
    assert restarted.state() == straight.state()
    assert restarted.alarm_since_hour == straight.alarm_since_hour is not None


@pytest.mark.parametrize("state", [{}, {"format": 1, "hours": "x"}, {"calibration_id": "r1", "hours": [{"hour": 1}]}])
def test_a_state_that_cannot_be_read_begins_anew(state) -> None:
    assert new_watch(state).reading() is None


def test_another_record_begins_anew() -> None:
    watch = new_watch()
    for hour in range(10):
        feed_hour(watch, hour, HANGING * 1.1)
    assert watch.alarm_since_hour is not None
    later = new_watch(watch.state(), make_record("r2"))
    assert later.alarm_since_hour is None
    assert later.reading() is None


@pytest.mark.slow
def test_memory_is_bounded() -> None:
    watch = new_watch()
    for hour in range(0, 24 * (DAYS_KEPT + 30), 6):
        feed_hour(watch, hour, HANGING * 1.000123456789, temperature_c=20.123456789, readings=30)
    state = watch.state()
    assert (len(state["hours"]), len(state["days"])) == (HOURS_KEPT, DAYS_KEPT)
    assert len(json.dumps(state)) < 120_000


def test_a_clock_that_was_not_set_or_went_back_makes_no_trend() -> None:
    watch = new_watch()
    for number in range(100):
        watch.feed(number * 10**9, HANGING, None)  # 1970
    assert (watch.misdated, watch.reading()) == (100, None)
    for hour in range(5):
        feed_hour(watch, hour, HANGING)
    for hour in range(24 * 3650, 24 * 3650 + 5):  # ten years ahead
        feed_hour(watch, hour, HANGING)
    for hour in range(5, 8):
        feed_hour(watch, hour, HANGING)
    hours = [mean["hour"] - FIRST_HOUR for mean in watch.state()["hours"]]
    assert hours == [0, 1, 2, 3, 4, 5, 6]
    assert "the clock was wrong" in rest_status(watch).reasons[-1]


def test_a_device_without_a_record_is_not_watched() -> None:
    info = DeviceInfo(kind="test", device_id="part-7", unit="g", odr_hz=100.0, units_per_g=1.0)
    with pytest.raises(CalibrationError, match="needs a calibration record"):
        RestDriftMonitor(correction_for(info, ((0, 1), (1, 1), (2, 1)), None))


def test_the_verdict_static_would_hide_a_drift_and_the_gates_of_stillness_do_not() -> None:
    """Why the watch is fed by `still` and `steady`: a drifted norm is no longer `static`."""
    rng = np.random.default_rng(7)
    condition = ConditionMonitor(noise_g=0.0005, permissible_norm_error_g=DM_G)
    for block in range(80):
        time_s = block * 0.1 + np.arange(10) * 0.01
        condition.update(time_s, HANGING * (1 + 2 * DM_G) + rng.normal(0, 0.0005, (10, 3)), clipped=0, missing=0)
    found = condition.judge(SwingContext(swinging=False, phi_max_rad=None, consistent=False))
    assert found.verdict != "static"
    assert at_rest(found.gates)
    assert not at_rest(found.gates | {"steady": False})
    assert not at_rest({"enough_data": False})
