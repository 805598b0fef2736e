"""Drift over successive records: the published tables, and simulated ageing."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from gateway.calibration.drift.change import change_between, reading_error_g, tilt_error_rad
from gateway.calibration.drift.forecast import analyse_drift
from gateway.calibration.drift.trend import fit_means, fit_measurements
from gateway.calibration.record import CalibrationError, CalibrationRecord, content_hash
from gateway.numerics.array import Array

DATA = Path(__file__).parents[2] / "data" / "calibration"
TABLES = json.loads((DATA / "luczak_2022_tables.json").read_text())
CHANGES = json.loads((DATA / "luczak_2022_drift.json").read_text())
START = datetime(2026, 1, 1, tzinfo=UTC)
COVERED = (0.93, 0.97)


def diagonal_record(
    day: float, offset: ArrayLike, scale: ArrayLike, u_offset: float, u_scale: float, **changes: Any
) -> CalibrationRecord:
    """Return a record of a sensor without cross-axis sensitivity: offsets in raw units, scale factors in raw units per g."""
    offset, scale = np.asarray(offset, dtype=np.float64), np.asarray(scale, dtype=np.float64)
    covariance = np.diag(np.concatenate([np.zeros(9), np.full(3, u_offset**2)]))
    covariance[[0, 4, 8], [0, 4, 8]] = (u_scale / scale**2) ** 2
    content = {
        "format": 1,
        "id": f"r{day}",
        "device_id": "part-7",
        "method": "six-position",
        "created_utc": (START + timedelta(days=day)).isoformat(),
        "software": "0.1.0",
        "by": "bench",
        "parent": None,
        "unit": "V",
        "offset": offset.tolist(),
        "correction_matrix": np.diag(1 / scale).tolist(),
        "covariance": covariance.tolist(),
        "prediction_interval_g": 0.003,
        "temperature_c": {"mean": 20.0, "min": 19.0, "max": 21.0},
    } | changes
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})


def table_record(hours: float, offset_v: ArrayLike, scale_v_per_g: ArrayLike) -> CalibrationRecord:
    """Return a record of the published values; half a sum of two means has the uncertainty of a mean over the root of two."""
    u_v = TABLES["type_A_uncertainty_V"] / np.sqrt(2)
    return diagonal_record(hours / 24, offset_v, scale_v_per_g, u_v, u_v, temperature_c=None)


@pytest.fixture
def six_hours() -> list[CalibrationRecord]:
    rows = zip(TABLES["table_6_offset_V"], TABLES["table_7_scale_V_per_g"], strict=True)
    return [
        table_record(offset["hours"], [offset[k] for k in "xyz"], [scale[k] for k in "xyz"]) for offset, scale in rows
    ]


@pytest.fixture
def two_days() -> list[CalibrationRecord]:
    offset_v = np.array([TABLES["table_6_offset_V"][0][k] for k in "xyz"])
    scale_v = np.array([TABLES["table_7_scale_V_per_g"][0][k] for k in "xyz"])
    later = [
        table_record(
            row["hours"],
            offset_v * (1 + np.array([row["offset"][k] for k in "xyz"]) / 100),
            scale_v * (1 + np.array([row["scale"][k] for k in "xyz"]) / 100),
        )
        for row in CHANGES["table_8_change_percent"]
    ]
    return [table_record(0, offset_v, scale_v), *later]


def test_the_changes_of_six_hours_agree_with_tables_6_and_7_within_their_rounding(
    six_hours: list[CalibrationRecord],
) -> None:
    first = six_hours[0]
    sensitivity = 1 / np.diag(np.array(first.correction_matrix))
    for row in range(4):
        change = change_between(first, six_hours[row + 1])
        offset_percent = 100 * change.offset_g * sensitivity / np.array(first.offset)
        printed = [CHANGES["table_6_change_percent"][row][k] for k in "xyz"]
        np.testing.assert_allclose(offset_percent, printed, atol=0.005 + 100 * 1e-4 / 1.4765)
        printed = [CHANGES["table_7_change_percent"][row][k] for k in "xyz"]
        np.testing.assert_allclose(100 * change.scale, printed, atol=0.005 + 100 * 1e-4 / 0.414)


def test_two_days_cause_the_tilt_error_of_equations_19_and_20(two_days: list[CalibrationRecord]) -> None:
    change = change_between(two_days[0], two_days[2])
    error_g = reading_error_g(change.offset_g, change.scale)
    assert 100 * error_g[2] == pytest.approx(
        CHANGES["eq_19_delta_g_percent"], abs=0.015
    )  # of -0.2 and -0.02, both rounded
    assert np.argmax(error_g) == 2
    assert change.tilt_error_deg.max() == pytest.approx(CHANGES["eq_20_tilt_error_deg"], abs=0.005)
    aged = CHANGES["eq_21"]
    assert np.degrees(tilt_error_rad(np.array([aged["delta_g_percent"] / 100])))[0] == pytest.approx(
        aged["tilt_error_deg"], abs=0.005
    )


def test_six_hours_show_no_trend_and_two_days_no_steady_trend(
    six_hours: list[CalibrationRecord], two_days: list[CalibrationRecord]
) -> None:
    report = analyse_drift(six_hours)
    assert not any(axis.shows_trend for axis in report.axes)
    assert any("no axis shows a trend" in text for text in report.warnings)
    assert report.within.expected_days is not None
    assert report.within.days < report.within.expected_days
    report = analyse_drift(two_days)
    assert [axis.axis for axis in report.axes if axis.offset_g.is_rejected] == ["z"]
    assert (report.within.days, report.within.axis) == (0.0, "z")
    change = change_between(two_days[0], two_days[2])
    assert abs(change.offset_g[2]) > 10 * change.u_offset_g[2]
    assert np.all(np.abs(change.offset_g[:2]) < 2 * change.u_offset_g[:2])


@pytest.mark.slow
def test_the_uncertainty_of_a_change_is_that_of_a_simulation() -> None:
    rng = np.random.default_rng(11)
    matrix = np.array([[2.4, 0.05, -0.02], [0.03, 2.41, 0.04], [0.0, -0.06, 2.39]])
    root = rng.normal(size=(12, 12)) * np.concatenate([np.full(9, 2e-4), np.full(3, 1e-4)])[:, None]
    covariance = root @ root.T

    def record(parameters: Array) -> CalibrationRecord:
        return diagonal_record(
            0,
            parameters[9:],
            [1, 1, 1],
            0,
            0,
            correction_matrix=parameters[:9].reshape(3, 3).tolist(),
            covariance=covariance.tolist(),
        )

    first = np.concatenate([matrix.ravel(), [1.47, 1.48, 1.51]])
    second = first + np.concatenate([np.full(9, 0.01), [0.02, -0.01, 0.03]])
    stated = change_between(record(first), record(second))
    drawn = []
    for _ in range(800):
        one, other = rng.multivariate_normal(first, covariance), rng.multivariate_normal(second, covariance)
        change = change_between(record(one), record(other))
        drawn.append(np.concatenate([change.gain.ravel(), change.offset_g, change.error_g(np.array([0, 0, 1.0]))[0]]))
    spread = np.std(drawn, axis=0)
    np.testing.assert_allclose(spread[:12], np.sqrt(np.diag(stated.covariance)), rtol=0.1)
    np.testing.assert_allclose(spread[12:], stated.error_g(np.array([0, 0, 1.0]))[1], rtol=0.1)


def test_a_change_is_the_error_of_the_earlier_record() -> None:
    earlier = diagonal_record(0, [1.0, 2.0, 3.0], [0.4, 0.5, 0.6], 1e-4, 1e-4)
    later = diagonal_record(9, [1.1, 2.0, 2.9], [0.4, 0.51, 0.6], 1e-4, 1e-4)
    force_g = np.array([0.3, -0.5, 0.8])
    raw = np.linalg.inv(np.array(later.correction_matrix)) @ force_g + np.array(later.offset)
    read_g = np.array(earlier.correction_matrix) @ (raw - np.array(earlier.offset))
    change = change_between(earlier, later)
    np.testing.assert_allclose(change.error_g(force_g)[0], read_g - force_g, atol=1e-12)
    assert np.all(change_between(earlier, later, is_reference=True).u_offset_g < change.u_offset_g)


def simulate_records(
    rng: np.random.Generator, rate_g_per_day: float, rate_per_day: float, days: ArrayLike, u_g: float = 0.0005
) -> list[CalibrationRecord]:
    """Return calibrations of an ageing sensor whose z offset and x scale drift, measured with noise."""
    made = []
    for day in np.asarray(days, dtype=np.float64).tolist():
        offset_g = rng.normal([0.0, 0.0, rate_g_per_day * day], u_g)
        scale = 1 + rng.normal([rate_per_day * day, 0.0, 0.0], u_g)
        made.append(diagonal_record(day, offset_g, scale, u_g, u_g, unit="g"))
    return made


@pytest.mark.slow
def test_the_trends_of_simulated_ageing_cover_the_true_rates() -> None:
    rng = np.random.default_rng(3)
    covered, found = [], 0
    for _ in range(120):
        days = np.sort(rng.uniform(0, 360, 5))
        report = analyse_drift(simulate_records(rng, 2e-5, -1e-5, days))
        z, x = report.axes[2].offset_g, report.axes[0].scale
        constant = [report.axes[0].offset_g, report.axes[1].offset_g, report.axes[1].scale, report.axes[2].scale]
        covered += [z.rate_low <= 2e-5 <= z.rate_high, x.rate_low <= -1e-5 <= x.rate_high]
        covered += [trend.rate_low <= 0 <= trend.rate_high for trend in constant]
        found += z.rate_low > 0
    assert COVERED[0] <= np.mean(covered) <= COVERED[1]
    assert found > 95  # the interval is narrow enough to detect the rate


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 4, 8])
def test_a_known_random_walk_of_any_size_is_covered(count: int) -> None:
    rng = np.random.default_rng(count)
    for random_walk in (0.0, 0.3, 3.0):
        covered = []
        for _ in range(1000):
            day = np.sort(rng.uniform(0, 90, count))
            walk = np.cumsum(rng.normal(0, random_walk * np.sqrt(np.diff(day, prepend=day[0]))))
            u_value = rng.uniform(0.7, 1.4, count)
            trend = fit_measurements(day, 0.1 * day + walk + rng.normal(0, u_value), u_value, random_walk)
            covered.append(trend.rate_low <= 0.1 <= trend.rate_high)
        assert COVERED[0] <= np.mean(covered) <= COVERED[1], random_walk


@pytest.mark.slow
def test_a_prediction_is_covered() -> None:
    rng = np.random.default_rng(8)
    covered = []
    for _ in range(1000):
        day = np.array([0.0, 30, 60, 90])
        walk = np.cumsum(rng.normal(0, 0.2 * np.sqrt([0.0, 30, 30, 30, 60])))
        value = 0.1 * day + walk[:4] + rng.normal(0, 1, 4)
        mean, half = fit_measurements(day, value, np.ones(4), 0.2).predict(np.array([150.0]))
        covered.append(abs(mean[0] - (15.0 + walk[4])) <= half[0])
    assert COVERED[0] <= np.mean(covered) <= COVERED[1]


def test_an_unknown_random_walk_widens_the_interval() -> None:
    rng = np.random.default_rng(4)
    day = np.linspace(0, 90, 8)
    walk = np.cumsum(rng.normal(0, 10, 8))
    with_walk = fit_measurements(day, walk + rng.normal(0, 1, 8), np.ones(8))
    steady = fit_measurements(day, 0.1 * day + rng.normal(0, 1, 8), np.ones(8))
    assert with_walk.is_rejected
    assert with_walk.random_walk == pytest.approx(10 / np.sqrt(90 / 7), rel=0.6)
    assert with_walk.rate_high - with_walk.rate_low > 5 * (steady.rate_high - steady.rate_low)


@pytest.mark.slow
def test_the_trend_of_means_of_unknown_scatter_is_covered_with_the_temperature_fitted() -> None:
    rng = np.random.default_rng(6)
    covered = []
    for _ in range(300):
        day = np.arange(20.0)
        temperature_c = 20 + 8 * np.sin(day / 3) + rng.normal(0, 1, 20)
        value = 0.03 * day + 0.5 * (temperature_c - 20) + rng.normal(0, 0.2, 20)
        trend = fit_means(day, value, temperature_c)
        covered.append(trend.rate_low <= 0.03 <= trend.rate_high)
    assert np.mean(covered) == pytest.approx(0.95, abs=0.035)
    with pytest.raises(CalibrationError, match="at least 4"):
        fit_means(day[:3], value[:3], temperature_c[:3])


@pytest.mark.slow
def test_the_limit_is_not_reached_before_the_forecast_day_in_19_of_20_sensors() -> None:
    """The true error reaches 0.5 degrees 436 days after the last record."""
    rng = np.random.default_rng(5)
    late, forecast_days = 0, []
    for _ in range(60):
        report = analyse_drift(simulate_records(rng, 2e-5, 0.0, [0, 60, 120, 180]), limit_deg=0.5)
        forecast_days.append(report.within.days)
        error_g = 2e-5 * (180 + report.within.days) - report.axes[2].last_offset_g
        late += error_g > np.sin(np.radians(0.5))
    assert late <= 3
    assert 60 < np.median(forecast_days) < 436


def test_two_records_are_reported_as_untestable() -> None:
    report = analyse_drift(
        [
            diagonal_record(30, [0.001, 0, 0], [1, 1, 1], 1e-4, 1e-4),
            diagonal_record(0, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4),
        ]
    )
    assert (report.records, report.span_days, report.first_utc[:10]) == (2, 30.0, "2026-01-01")
    assert any("cannot be checked" in text for text in report.warnings)
    assert not report.axes[0].offset_g.is_rejected


def test_other_methods_are_skipped_and_other_temperatures_reported() -> None:
    records = [diagonal_record(day, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4) for day in (0, 30, 60)]
    zero = diagonal_record(45, [0.5, 0, 0], [1, 1, 1], 1e-4, 1e-4, method="zero")
    warm = diagonal_record(90, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4, temperature_c={"mean": 32.0, "min": 30.0, "max": 34.0})
    report = analyse_drift([*records, zero, warm])
    assert report.records == 4
    assert "skipped: 1 of 5" in report.warnings[0]
    assert "20 to 32 °C" in report.warnings[-1]
    assert report.within.expected_days is None


@pytest.mark.parametrize(
    ("other", "text"),
    [
        ({"device_id": "part-8"}, "drift is that of one device"),
        ({"unit": "counts"}, "needs one unit"),
        ({"created_utc": "yesterday"}, "'yesterday' is no ISO 8601 time"),
        ({"created_utc": "2026-01-01T00:00:00"}, "not at rising times"),
        ({"method": "zero"}, "two calibrations at least"),
        ({"correction_matrix": [[1, 0, 0], [0, 0, 0], [0, 0, 1]]}, "singular"),
        ({"covariance": np.zeros((12, 12)).tolist()}, "no uncertainty"),
    ],
)
def test_records_that_are_no_series_are_refused_with_the_reason(other: dict[str, Any], text: str) -> None:
    records = [
        diagonal_record(0, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4),
        diagonal_record(5, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4, **other),
    ]
    with pytest.raises(CalibrationError, match=text):
        analyse_drift(records)
