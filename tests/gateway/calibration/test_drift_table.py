"""Tables of drift: the published ones, a fleet with the most urgent sensor first, and how long a type of sensor holds."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.calibration.acceptance import make_record
from gateway.calibration.drift.change import reading_error_g, tilt_error_rad
from gateway.calibration.drift.fleet_drift import DriftRow, drift_table, fleet_drift, learn_days, learn_type_drift
from gateway.calibration.drift.trend import HORIZON_DAYS
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.pose import Pose, find_face
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.cli.main import main
from gateway.numerics.stats import NORMAL_975
from tests.gateway.calibration.test_drift_forecast import CHANGES, TABLES, diagonal_record
from tests.values import present

START = datetime(2026, 1, 1, tzinfo=UTC)
ROUNDING_V = 0.5e-4
"""Half of the last digit of the published voltages."""
NOW = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=400)
LIMIT_G = float(np.sin(np.radians(0.5)))
U_G = 0.0005
FLEETS = 200


def record_of_table(number: int) -> CalibrationRecord:
    """Return the six-position record of Tables 1 to 5 of Łuczak et al. 2022."""
    table = TABLES["tables_1_to_5"][number]
    u_v = TABLES["type_A_uncertainty_V"]
    means = [(row["U_x_V"], row["U_y_V"], row["U_z_V"]) for row in table["positions"]]
    poses = tuple(Pose(mean, (u_v, u_v, u_v), 300, find_face((np.array(mean) - 1.5) / 0.42)) for mean in means)
    made = START + timedelta(hours=table["hours_since_start"])
    return make_record(
        fit_six_positions(poses), device_id="adxl327", unit="V", software="0.1.0", by="bench",
        created_utc=made.isoformat(), parent=None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def rows() -> tuple[DriftRow, ...]:
    return drift_table([record_of_table(number) for number in (3, 0, 4, 1, 2)])


def test_tables_6_and_7_follow_from_tables_1_to_5(rows: tuple[DriftRow, ...]) -> None:
    assert [row.elapsed_h for row in rows] == [0, 1, 2, 4, 6]
    for row, offset, scale in zip(rows, TABLES["table_6_offset_V"], TABLES["table_7_scale_V_per_g"], strict=True):
        np.testing.assert_allclose(row.offset, [offset[axis] for axis in "xyz"], atol=1.01 * ROUNDING_V)
        np.testing.assert_allclose(row.scale, [scale[axis] for axis in "xyz"], atol=1.01 * ROUNDING_V)


def test_the_changes_in_per_cent_agree_within_the_rounding_of_the_voltages(rows: tuple[DriftRow, ...]) -> None:
    for row, offset, scale in zip(
        rows[1:], CHANGES["table_6_change_percent"], CHANGES["table_7_change_percent"], strict=True
    ):
        printed = np.array([[values[axis] for axis in "xyz"] for values in (offset, scale)])
        found = 100 * np.array([row.offset_change, row.scale_change])
        rounding = 0.005 + 100 * 2 * ROUNDING_V / np.array([rows[0].offset, rows[0].scale])
        assert np.all(np.abs(found - printed) < rounding)
    largest = 100 * np.max([np.abs(row.offset_change) for row in rows[1:]], axis=0)
    np.testing.assert_allclose(largest, [0.02, 0.02, 0.02], atol=0.005)
    largest = 100 * np.max([np.abs(row.scale_change) for row in rows[1:]], axis=0)
    np.testing.assert_allclose(largest, [0.06, 0.04, 0.02], atol=0.01)


def test_equations_19_to_21_follow_from_table_8() -> None:
    worst = CHANGES["table_8_change_percent"][1]
    first = record_of_table(0)
    offset, scale = first.offset[2], 1 / first.correction_matrix[2][2]
    error = reading_error_g(
        np.array([worst["offset"]["z"] / 100 * offset / scale]), np.array([worst["scale"]["z"] / 100])
    )
    assert 100 * error[0] == pytest.approx(CHANGES["eq_19_delta_g_percent"], abs=0.0051)
    assert np.degrees(tilt_error_rad(error))[0] == pytest.approx(CHANGES["eq_20_tilt_error_deg"], abs=0.005)
    aged = CHANGES["eq_21"]
    found_deg = np.degrees(tilt_error_rad(np.array([aged["delta_g_percent"] / 100])))[0]
    assert found_deg == pytest.approx(aged["tilt_error_deg"], abs=0.005)


def test_a_tilt_error_is_the_arcsine_and_a_right_angle_from_1_g() -> None:
    """The difference to the argument itself is below the printed digits of the source."""
    np.testing.assert_allclose(np.degrees(tilt_error_rad(np.array([0.5, -0.5, 1.0, 1.05]))), [30.0, 30.0, 90.0, 90.0])


def test_figure_7_and_table_8_follow_from_the_calibrations_of_48_hours() -> None:
    first = record_of_table(0)
    offset, scale = np.array(first.offset), 1 / np.diag(np.array(first.correction_matrix))
    later = [
        diagonal_record(
            row["hours"] / 24,
            offset * (1 + np.array([row["offset"][axis] for axis in "xyz"]) / 100),
            scale * (1 + np.array([row["scale"][axis] for axis in "xyz"]) / 100),
            1.7e-4,
            1.7e-4,
        )
        for row in CHANGES["table_8_change_percent"]
    ]
    start = diagonal_record(0, offset, scale, 1.7e-4, 1.7e-4)
    found = drift_table([start, *later])
    for row, printed in zip(found[1:], CHANGES["table_8_change_percent"], strict=True):
        np.testing.assert_allclose(100 * row.offset_change, [printed["offset"][axis] for axis in "xyz"], atol=1e-9)
        np.testing.assert_allclose(100 * row.scale_change, [printed["scale"][axis] for axis in "xyz"], atol=1e-9)
    assert np.degrees(found[2].tilt_error_rad.max()) == pytest.approx(0.43, abs=0.005)


def sensor(device_id: str, days: list[float], mg_per_day: float) -> list[CalibrationRecord]:
    return [
        diagonal_record(
            day, [0.0, 0.0, mg_per_day / 1000 * day], [1.0] * 3, 1e-4, 1e-4,
            device_id=device_id, id=f"{device_id}-{day}", unit="g",
        )
        for day in days
    ]  # fmt: skip


def test_the_most_urgent_sensor_stands_first_with_planted_drift_and_date() -> None:
    records = [
        *sensor("steady", [0, 100, 200, 300], 0.0),
        *sensor("drifting", [0, 100, 200, 300], 0.04),
        *sensor("single", [390], 0.0),
        *sensor("forgotten", [0], 0.0),
    ]
    sensors, failures = fleet_drift(records, NOW, limit_deg=0.5, interval_days=365)
    assert failures == ()
    assert [one.device_id for one in sensors] == ["forgotten", "drifting", "steady", "single"]
    forgotten, drifting, steady, single = sensors
    assert (forgotten.is_overdue, forgotten.drift_deg, forgotten.basis) == (True, None, "interval")
    assert forgotten.due_days == pytest.approx(-35)
    assert drifting.basis == "forecast"
    limit_days = 1000 * np.sin(np.radians(0.5)) / 0.04
    assert 0.5 * limit_days < (drifting.next_utc - START).days - 300 < limit_days
    assert present(drifting.drift_deg) == pytest.approx(np.degrees(0.004), abs=2 * present(drifting.u_drift_deg))
    assert steady.due_days == pytest.approx(265)
    assert single.age_days == pytest.approx(10)
    assert single.records == 1


def test_records_that_cannot_be_judged_are_named_and_the_others_stay() -> None:
    mixed = [*sensor("good", [0, 10], 0.0), *sensor("bad", [0], 0.0)]
    mixed.append(diagonal_record(5, [0.0] * 3, [1.0] * 3, 1e-4, 1e-4, device_id="bad", id="bad-5", unit="V"))
    sensors, (failure,) = fleet_drift(mixed, NOW, limit_deg=0.5)
    assert [one.device_id for one in sensors] == ["good"]
    assert failure.startswith("bad: ")
    with pytest.raises(CalibrationError, match="none of 0 records"):
        drift_table([])


@pytest.fixture
def store(tmp_path: Path) -> Path:
    folder = tmp_path / "store"
    folder.mkdir()
    for record in [record_of_table(number) for number in range(5)] + sensor("drifting", [0, 100, 200], 0.08):
        (folder / f"{record.device_id}-{record.id}.json").write_text(json.dumps(record.model_dump(mode="json")))
    (folder / "notes.json").write_text("{}")
    return folder


def run(*arguments: Any) -> int:
    return main(["fleet", "drift", *map(str, arguments)])


def test_the_command_prints_a_table_and_writes_json_and_a_report(
    store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, page = tmp_path / "drift.json", tmp_path / "drift.html"
    assert run(store, "--on", "2026-08-01", "--json", out, "--html", page) == 0
    output = capsys.readouterr().out.splitlines()
    assert output[1].startswith("drifting")
    assert "left out" in output[-1]
    result = json.loads(out.read_text())
    assert [one["device_id"] for one in result["sensors"]] == ["drifting", "adxl327"]
    assert result["sensors"][1]["table"][1]["offset_change_percent"][2] == pytest.approx(-0.02, abs=0.005)
    text = page.read_text()
    assert "Tables 6 to 8" in text
    assert text.count("<svg") == 4  # offset and scale factor of two sensors


def kept(folder: Path, device_id: str, changes: list[tuple[str | None, str | None]]) -> Path:
    """A store as the gateway keeps it, with three records and its other files."""
    records = sensor(device_id, [0, 100, 200], 0.08)
    (folder / device_id / "records").mkdir(parents=True)
    names: dict[str | None, str | None] = {None: None} | dict(zip("abc", (each.id for each in records), strict=True))
    for each in records:
        (folder / device_id / "records" / f"{each.id}.json").write_text(json.dumps(each.model_dump(mode="json")))
    why = {"time_utc": "2026-08-01T00:00:00Z", "by": "ann", "reason": "wrong face", "request": "r"}
    history: list[dict[str, str | None]] = [
        {**why, "from": names[before], "to": names[after]} for before, after in changes
    ]
    state = {"device_id": device_id, "in_force": history[-1]["to"], "history": history}
    (folder / device_id / "in_force.json").write_text(json.dumps(state))
    for name in ("session.json", f"{device_id}/drift.json"):
        (folder / name).write_text("{}")
    return folder


def test_a_record_that_was_withdrawn_is_not_counted_and_files_of_the_store_are_no_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "drift.json"
    forward: list[tuple[str | None, str | None]] = [(None, "a"), ("a", "b"), ("b", "c")]
    for number, (changes, counted) in enumerate(
        [(forward, 3), ([*forward, ("c", "b")], 2), ([*forward, ("c", "b"), ("b", "c")], 3), ([*forward[:2]], 2)]
    ):
        folder = kept(tmp_path / f"store-{number}", "part", changes)
        assert run(folder, "--on", "2026-08-02", "--json", out) in (0, 1)
        told = capsys.readouterr().out
        assert json.loads(out.read_text())["sensors"][0]["records"] == counted, changes
        assert told.count("note: ") == 3 - counted, told
    assert "it was never in force" in told
    run(tmp_path / "store-1", "--on", "2026-08-02")
    assert "it was withdrawn on 2026-08-01 by ann: wrong face" in capsys.readouterr().out


def test_a_sensor_whose_every_record_was_withdrawn_cannot_be_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = kept(tmp_path / "store", "part", [(None, "a"), ("a", None)])
    assert run(folder, "--on", "2026-08-02") == 1
    assert "note: part: no record that was made is in force" in capsys.readouterr().out


@pytest.mark.slow
def test_an_overdue_sensor_is_exit_code_1_and_bad_input_2(
    store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(store, "--on", "2030-01-01") == 1
    assert "OVERDUE" in capsys.readouterr().out
    bad = tmp_path / "bad.json"
    bad.write_text('{"format": 1}')
    assert run(bad) == 2
    assert "bad.json: is no calibration record" in capsys.readouterr().err
    assert run(tmp_path / "none.json") == 2
    assert run(store / "..", "--on", "2026-08-01") == 0


@pytest.mark.parametrize("sensors", [5, 30])
@pytest.mark.parametrize(("walk_g", "rate_g"), [(0.0003, 0.0), (0.0, 1e-5), (0.0002, 5e-6)])
def test_the_interval_holds_the_true_days_in_nineteen_of_twenty_fleets(
    walk_g: float, rate_g: float, sensors: int
) -> None:
    rng = np.random.default_rng(1)
    true_days = np.roots([rate_g**2, walk_g**2, -((LIMIT_G / NORMAL_975) ** 2)]).max() if rate_g else 0.0
    true_days = min(true_days or (LIMIT_G / NORMAL_975 / walk_g) ** 2, HORIZON_DAYS)
    held = too_late = 0
    for _ in range(FLEETS):
        span_days = np.repeat(rng.uniform(100, 700, sensors), 3)
        variance_g2 = np.full(3 * sensors, 2 * U_G**2)
        total_g = np.sqrt(walk_g**2 * span_days + rate_g**2 * span_days**2 + variance_g2)
        found = learn_days(span_days, rng.normal(0, total_g), variance_g2, sensors, LIMIT_G)
        held += found.low_days <= true_days <= found.high_days
        too_late += found.low_days > true_days

    assert held >= 0.95 * FLEETS
    assert too_late <= 0.05 * FLEETS


def test_a_type_is_learned_from_three_sensors_that_were_calibrated_twice() -> None:
    now = datetime(2026, 11, 22, tzinfo=UTC)
    records = [sensor(f"part-{number}", [0, 200], 0.02 * number) for number in (1, -1, 2)]
    sensors, _ = fleet_drift([record for own in records for record in own], now, limit_deg=0.5)
    assert learn_type_drift(sensors[:2], 0.5) is None
    found = learn_type_drift(sensors, 0.5)
    assert found is not None
    assert found.sensors == 3
    assert found.low_days < found.days <= found.high_days


def test_sensors_that_do_not_drift_need_no_calibration_up_to_the_horizon() -> None:
    span_days, variance_g2 = np.full(90, 3000.0), np.full(90, 1e-10)
    found = learn_days(span_days, np.zeros(90), variance_g2, 30, LIMIT_G)
    assert (found.low_days, found.high_days) == (HORIZON_DAYS, HORIZON_DAYS)
