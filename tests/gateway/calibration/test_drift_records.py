"""Drift between successive records: the published tables, and simulated ageing."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.drift.change import change_between, observable_change, reading_error_g, tilt_error_rad
from gateway.calibration.drift.forecast import drift_of
from gateway.calibration.drift.trend import line_of_means, line_of_measurements
from gateway.calibration.record import CalibrationError, CalibrationRecord, content_hash

DATA = Path(__file__).parents[2] / "data" / "calibration"
TABLES = json.loads((DATA / "luczak_2022_tables.json").read_text())
CHANGES = json.loads((DATA / "luczak_2022_drift.json").read_text())
START = datetime(2026, 1, 1, tzinfo=UTC)
COVERED = (0.93, 0.97)


def diagonal_record(day: float, offset, scale, u_offset: float, u_scale: float, **changes) -> CalibrationRecord:
    """A record of a sensor without cross-axis sensitivity; offsets in the unit, scale factors in units per g."""
    offset, scale = np.array(offset, dtype=float), np.array(scale, dtype=float)
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


def table_record(hours: float, offset_v, scale_v_per_g) -> CalibrationRecord:
    """Half the sum and half the difference of two means have the uncertainty of a mean over the root of two."""
    u_v = TABLES["type_A_uncertainty_V"] / np.sqrt(2)
    return diagonal_record(hours / 24, offset_v, scale_v_per_g, u_v, u_v, temperature_c=None)


@pytest.fixture
def six_hours() -> list[CalibrationRecord]:
    rows = zip(TABLES["table_6_offset_V"], TABLES["table_7_scale_V_per_g"], strict=True)
    return [table_record(of["hours"], [of[k] for k in "xyz"], [sf[k] for k in "xyz"]) for of, sf in rows]


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


def test_six_hours_changed_as_tables_6_and_7_say_within_what_their_rounding_hides(six_hours) -> None:
    first = six_hours[0]
    sensitivity = 1 / np.diag(np.array(first.correction_matrix))
    for row in range(4):
        change = change_between(first, six_hours[row + 1])
        offset_percent = 100 * change.offset_g * sensitivity / np.array(first.offset)
        printed = [CHANGES["table_6_change_percent"][row][k] for k in "xyz"]
        np.testing.assert_allclose(offset_percent, printed, atol=0.005 + 100 * 1e-4 / 1.4765)
        printed = [CHANGES["table_7_change_percent"][row][k] for k in "xyz"]
        np.testing.assert_allclose(100 * change.scale, printed, atol=0.005 + 100 * 1e-4 / 0.414)


def test_two_days_make_the_tilt_error_of_equations_19_and_20(two_days) -> None:
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


def test_six_hours_show_no_trend_as_the_source_says_and_two_days_no_steady_one(six_hours, two_days) -> None:
    report = drift_of(six_hours)
    assert not any(axis.shows_trend for axis in report.axes)
    assert any("no axis shows a trend" in said for said in report.warnings)
    assert report.within.days < report.within.expected_days
    report = drift_of(two_days)
    assert [axis.axis for axis in report.axes if axis.offset_g.contradicted] == ["z"]
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

    def record(parameters) -> CalibrationRecord:
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
    said = change_between(record(first), record(second))
    drawn = []
    for _ in range(800):
        one, other = rng.multivariate_normal(first, covariance), rng.multivariate_normal(second, covariance)
        change = change_between(record(one), record(other))
        drawn.append(np.concatenate([change.gain.ravel(), change.offset_g, change.error_g(np.array([0, 0, 1.0]))[0]]))
    spread = np.std(drawn, axis=0)
    np.testing.assert_allclose(spread[:12], np.sqrt(np.diag(said.covariance)), rtol=0.1)
    np.testing.assert_allclose(spread[12:], said.error_g(np.array([0, 0, 1.0]))[1], rtol=0.1)


def test_a_change_is_what_the_earlier_record_reads_wrong_now() -> None:
    earlier = diagonal_record(0, [1.0, 2.0, 3.0], [0.4, 0.5, 0.6], 1e-4, 1e-4)
    later = diagonal_record(9, [1.1, 2.0, 2.9], [0.4, 0.51, 0.6], 1e-4, 1e-4)
    force_g = np.array([0.3, -0.5, 0.8])
    raw = np.linalg.inv(np.array(later.correction_matrix)) @ force_g + np.array(later.offset)
    read_g = np.array(earlier.correction_matrix) @ (raw - np.array(earlier.offset))
    change = change_between(earlier, later)
    np.testing.assert_allclose(change.error_g(force_g)[0], read_g - force_g, atol=1e-12)
    assert np.all(observable_change(earlier, later).u_offset_g < change.u_offset_g)


def simulated(
    rng, planted_g_per_day: float, planted_per_day: float, days, u_g: float = 0.0005
) -> list[CalibrationRecord]:
    """Calibrations of an ageing sensor: z offset and x scale drift, everything is measured with noise."""
    made = []
    for day in days:
        offset_g = rng.normal([0.0, 0.0, planted_g_per_day * day], u_g)
        scale = 1 + rng.normal([planted_per_day * day, 0.0, 0.0], u_g)
        made.append(diagonal_record(float(day), offset_g, scale, u_g, u_g, unit="g"))
    return made


@pytest.mark.slow
def test_trends_of_simulated_ageing_cover_what_was_planted() -> None:
    rng = np.random.default_rng(3)
    covered, found = [], 0
    for _ in range(120):
        days = np.sort(rng.uniform(0, 360, 5))
        report = drift_of(simulated(rng, 2e-5, -1e-5, days))
        z, x = report.axes[2].offset_g, report.axes[0].scale
        still = [report.axes[0].offset_g, report.axes[1].offset_g, report.axes[1].scale, report.axes[2].scale]
        covered += [z.rate_low <= 2e-5 <= z.rate_high, x.rate_low <= -1e-5 <= x.rate_high]
        covered += [line.rate_low <= 0 <= line.rate_high for line in still]
        found += z.rate_low > 0
    assert COVERED[0] <= np.mean(covered) <= COVERED[1]
    assert found > 95  # the interval is narrow enough to be of use


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 4, 8])
def test_a_known_wander_is_covered_whatever_its_size(count: int) -> None:
    rng = np.random.default_rng(count)
    for wander in (0.0, 0.3, 3.0):
        covered = []
        for _ in range(1000):
            day = np.sort(rng.uniform(0, 90, count))
            walk = np.cumsum(rng.normal(0, wander * np.sqrt(np.diff(day, prepend=day[0]))))
            u_value = rng.uniform(0.7, 1.4, count)
            line = line_of_measurements(day, 0.1 * day + walk + rng.normal(0, u_value), u_value, wander)
            covered.append(line.rate_low <= 0.1 <= line.rate_high)
        assert COVERED[0] <= np.mean(covered) <= COVERED[1], wander


def test_an_error_predicted_for_later_is_covered() -> None:
    rng = np.random.default_rng(8)
    covered = []
    for _ in range(1000):
        day = np.array([0.0, 30, 60, 90])
        walk = np.cumsum(rng.normal(0, 0.2 * np.sqrt([0.0, 30, 30, 30, 60])))
        value = 0.1 * day + walk[:4] + rng.normal(0, 1, 4)
        mean, half = line_of_measurements(day, value, np.ones(4), 0.2).predict(np.array([150.0]))
        covered.append(abs(mean[0] - (15.0 + walk[4])) <= half[0])
    assert COVERED[0] <= np.mean(covered) <= COVERED[1]


def test_an_unknown_wander_widens_the_interval() -> None:
    rng = np.random.default_rng(4)
    day = np.linspace(0, 90, 8)
    walk = np.cumsum(rng.normal(0, 10, 8))
    wandering = line_of_measurements(day, walk + rng.normal(0, 1, 8), np.ones(8))
    steady = line_of_measurements(day, 0.1 * day + rng.normal(0, 1, 8), np.ones(8))
    assert wandering.contradicted
    assert wandering.wander == pytest.approx(10 / np.sqrt(90 / 7), rel=0.6)
    assert wandering.rate_high - wandering.rate_low > 5 * (steady.rate_high - steady.rate_low)


@pytest.mark.slow
def test_means_of_unknown_scatter_with_a_temperature_beside_time() -> None:
    rng = np.random.default_rng(6)
    covered = []
    for _ in range(300):
        day = np.arange(20.0)
        warm_c = 20 + 8 * np.sin(day / 3) + rng.normal(0, 1, 20)
        value = 0.03 * day + 0.5 * (warm_c - 20) + rng.normal(0, 0.2, 20)
        line = line_of_means(day, value, warm_c)
        covered.append(line.rate_low <= 0.03 <= line.rate_high)
    assert np.mean(covered) == pytest.approx(0.95, abs=0.035)
    with pytest.raises(CalibrationError, match="at least 4"):
        line_of_means(day[:3], value[:3], warm_c[:3])


@pytest.mark.slow
def test_recalibrate_before_the_limit_is_reached_in_19_of_20_sensors() -> None:
    """The planted error reaches 0.5 degrees 436 days after the last record."""
    rng = np.random.default_rng(5)
    late, told = 0, []
    for _ in range(60):
        report = drift_of(simulated(rng, 2e-5, 0.0, [0, 60, 120, 180]), limit_deg=0.5)
        told.append(report.within.days)
        error_g = 2e-5 * (180 + report.within.days) - report.axes[2].last_offset_g
        late += error_g > np.sin(np.radians(0.5))
    assert late <= 3
    assert 60 < np.median(told) < 436


def test_two_records_say_that_a_line_through_them_proves_nothing() -> None:
    report = drift_of(
        [
            diagonal_record(30, [0.001, 0, 0], [1, 1, 1], 1e-4, 1e-4),
            diagonal_record(0, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4),
        ]
    )
    assert (report.records, report.span_days, report.first_utc[:10]) == (2, 30.0, "2026-01-01")
    assert any("cannot be checked" in said for said in report.warnings)
    assert not report.axes[0].offset_g.checked


def test_other_records_are_passed_over_and_other_conditions_told() -> None:
    made = [diagonal_record(day, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4) for day in (0, 30, 60)]
    zero = diagonal_record(45, [0.5, 0, 0], [1, 1, 1], 1e-4, 1e-4, method="zero")
    warm = diagonal_record(90, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4, temperature_c={"mean": 32.0, "min": 30.0, "max": 34.0})
    report = drift_of([*made, zero, warm])
    assert report.records == 4
    assert "passed over: 1 of 5" in report.warnings[0]
    assert "20 to 32 °C" in report.warnings[-1]
    assert report.within.expected_days is None


@pytest.mark.parametrize(
    ("other", "said"),
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
def test_records_that_make_no_series_are_refused_with_the_reason(other, said: str) -> None:
    records = [
        diagonal_record(0, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4),
        diagonal_record(5, [0, 0, 0], [1, 1, 1], 1e-4, 1e-4, **other),
    ]
    with pytest.raises(CalibrationError, match=said):
        drift_of(records)
