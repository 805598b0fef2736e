"""Calibration of an installed housing: planted weeks of swings and rests, by equations of motion apart from the product."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.bench.installed.free_motion import FreeMotionFinder
from gateway.bench.installed.installed_calibration import InstalledCalibration, format_installed
from gateway.calibration.acceptance import make_record
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.errors import InputError
from gateway.swing.rig import MountedHousing
from tests.gateway.bench.intervals.service import IN_UNITS, believed, calibrated, wide_record
from tests.gateway.bench.planted.service import (
    G_M_S2,
    RATE_HZ,
    Installed,
    Recorded,
    Weeks,
    draw_installed,
    weeks_of_service,
)
from tests.gateway.bench.planted.thermal import Values
from tests.values import present

QUIET = Weeks(days=10, white_g=1e-7, flicker_g=0.0, gust=0.0, lean_rad=0.0)
USUAL = Weeks(days=12)
CRANE = Installed(length_m=12.0, above_load_m=6.5)
HOUSING = believed(CRANE)


@pytest.fixture(scope="module")
def weeks() -> tuple[Installed, list[Recorded]]:
    random = np.random.default_rng(5)
    crane = replace(draw_installed(random), length_m=12.0, above_load_m=6.0)
    return crane, weeks_of_service(random, crane, USUAL)


def value_of(found: InstalledCalibration, name: str) -> float:
    return found.rows[name].value / IN_UNITS.get(name.rsplit("_", maxsplit=1)[-1], 100)


@pytest.mark.parametrize(("above_load_m", "scale_error"), [(3.0, 5e-3), (8.0, 1.5e-3)])
def test_a_sensor_without_noise_is_found_to_the_accuracy_of_the_equations(
    above_load_m: float, scale_error: float
) -> None:
    """Near the load 15 mm of the place are half a per cent of the scale."""
    random = np.random.default_rng(4)
    crane = replace(draw_installed(random), length_m=12.0, above_load_m=above_load_m, offset_g_per_c=np.zeros(3))
    crane = replace(crane, cross=np.zeros((3, 3)))
    recorded = weeks_of_service(random, crane, QUIET)
    found = calibrated(recorded, believed(crane, place_error_m=0.15))
    errors = {
        name: value_of(found, name) - truth
        for name, truth in crane.deviations(recorded).items()
        if not name.startswith(("offset", "mount"))
    }
    assert found.rows["place_m"].value == pytest.approx(above_load_m, abs=0.015)
    assert {name: error for name, error in errors.items() if "scale" in name} == pytest.approx(
        dict.fromkeys(("scale_x", "scale_y", "scale_y_over_x"), 0.0), abs=scale_error
    )
    assert [errors[f"windless_{axis}_g"] for axis in "xy"] == pytest.approx([0.0, 0.0], abs=3e-4)
    assert errors["along_g"] == pytest.approx(0.0, abs=5e-6)
    # the place beside the rope reads as a mount, and is in the interval
    for name in ("offset_x_g", "offset_y_g", "mount_about_x_rad", "mount_about_y_rad"):
        row = found.rows[name]
        assert abs(row.value - crane.deviations(recorded)[name] * IN_UNITS[name.rsplit("_", maxsplit=1)[-1]]) < row.half


def test_a_housing_that_is_placed_from_the_pivot_is_found_on_a_rope_of_one_length() -> None:
    random = np.random.default_rng(6)
    recorded = weeks_of_service(random, CRANE, replace(QUIET, hoist=0.0))
    housing = MountedHousing(length_m=12.0, position_m=5.3, position_u_m=0.1, mount_u_rad=0.01)
    found = calibrated(recorded, housing)
    assert found.rows["place_m"].value == pytest.approx(CRANE.length_m - CRANE.above_load_m, abs=0.01)
    assert found.rows["place_m"].name == "housing from the pivot"


def test_the_lean_of_each_day_widens_what_it_moves_and_nothing_else() -> None:
    halves = []
    for lean_rad in (0.001, 0.01):
        recorded = weeks_of_service(np.random.default_rng(7), CRANE, replace(USUAL, lean_rad=lean_rad))
        rows = calibrated(recorded, HOUSING).rows
        halves.append([rows[name].half for name in ("across_x_g", "offset_x_g", "windless_x_g", "scale_y_over_x")])
    calm, windy = np.array(halves)
    assert windy[0] > 3 * calm[0]
    assert windy[1] > 1.2 * calm[1]  # a rope that is not plumb is in both
    assert (windy[2:] < 2 * calm[2:]).all()


def test_a_steady_lean_reads_as_mount_and_offset_and_moves_no_sum_without_wind() -> None:
    rows = [
        calibrated(
            weeks_of_service(np.random.default_rng(8), CRANE, replace(QUIET, steady_lean_rad=(lean_rad, 0.0))), HOUSING
        ).rows
        for lean_rad in (0.0, 0.01)
    ]
    moved = {name: rows[1][name].value - rows[0][name].value for name in rows[0]}
    lever = float(np.mean([CRANE.above_load_m / each for each in (10.2, 13.8)]))
    assert moved["across_x_g"] == pytest.approx(10.0, abs=0.1)
    assert moved["mount_about_y_rad"] == pytest.approx(np.degrees(0.01 / lever), rel=0.1)
    assert moved["offset_x_g"] == pytest.approx(10.0 * (1 - 1 / lever), abs=1.0)
    assert moved["windless_x_g"] == pytest.approx(0.0, abs=0.05)


def test_leans_that_change_leave_the_level_along_the_rope() -> None:
    """A rope that leans by 0.01 rad reads 0.05 mg less along it, in each of two directions."""
    recorded = weeks_of_service(np.random.default_rng(12), CRANE, replace(QUIET, days=20, lean_rad=0.01))
    along_g = value_of(calibrated(recorded, HOUSING), "along_g")
    assert along_g == pytest.approx(CRANE.deviations(recorded)["along_g"], abs=1e-5)


def test_swings_in_one_direction_leave_the_other_scale_undetermined() -> None:
    along_x = replace(USUAL, directions_rad=(0.0, 0.0), ellipse=0.0)
    rows = calibrated(weeks_of_service(np.random.default_rng(9), CRANE, along_x), HOUSING).rows
    assert "scale_x" in rows
    assert not {"scale_y", "scale_y_over_x", "offset_x_g", "windless_y_g"} & set(rows)


def test_an_offered_record_corrects_what_was_found(weeks: tuple[Installed, list[Recorded]]) -> None:
    crane, recorded = weeks
    first = calibrated(recorded, believed(crane))
    offer = present(first.offer)
    record = make_record(
        offer,
        device_id="part-7",
        unit="g",
        software="0.1.0",
        by="bench",
        created_utc="2026-02-01T00:00:00Z",
        parent="p",
    )
    again = [replace(each, raw_g=corrected(record, each.raw_g)) for each in recorded]
    for name in ("scale_x", "scale_y", "offset_x_g", "offset_y_g"):
        row = calibrated(again, believed(crane)).rows[name]
        assert abs(row.value) < max(0.1 * row.half, 0.02), name
        assert record.u_scale_factor[0] == pytest.approx(first.rows["scale_x"].half / 196, rel=0.01)


def corrected(record: CalibrationRecord, raw_g: Values) -> Values:
    return np.asarray((raw_g - np.array(record.offset)) @ np.array(record.correction_matrix).T)


def test_a_better_parent_is_confirmed_and_nothing_is_offered() -> None:
    found = calibrated(weeks_of_service(np.random.default_rng(2), CRANE, USUAL), HOUSING, wide_record(1e-4, 1e-4))
    assert found.offer is None
    assert not found.is_contradicted
    assert "is confirmed within these intervals" in format_installed(found, "r")


@pytest.mark.parametrize(
    ("name", "crane", "housing"),
    [
        ("place_m", CRANE, believed(CRANE, place_error_m=1.2)),
        ("length_m", CRANE, replace(HOUSING, length_m=17.0)),
        ("along_g", replace(CRANE, offset_g=np.array([0.0, 0.0, 0.1])), HOUSING),
        ("scale_y_over_x", replace(CRANE, scale=np.array([0.0, 0.12, 0.0])), HOUSING),
        ("windless_x_g", replace(CRANE, offset_g=np.array([0.06, 0.0, 0.0])), HOUSING),
    ],
)
def test_what_is_stated_wrongly_is_contradicted(name: str, crane: Installed, housing: MountedHousing) -> None:
    found = calibrated(weeks_of_service(np.random.default_rng(3), crane, USUAL), housing)
    assert not found.rows[name].agrees, format_installed(found, "r")
    assert found.rows[name].name in format_installed(found, "r").split("contradicted: ")[1]
    if name in ("place_m", "length_m"):
        assert found.offer is None


def test_a_spreader_that_is_not_stated_is_refused() -> None:
    crane = replace(CRANE, above_load_m=1.2, spreader=True)
    with pytest.raises(NotDeterminedError, match="on a spreader no motion reads as a swing"):
        calibrated(weeks_of_service(np.random.default_rng(3), crane, USUAL), believed(crane))


def test_few_days_and_another_axis_along_the_rope_are_refused(weeks: tuple[Installed, list[Recorded]]) -> None:
    crane, recorded = weeks
    with pytest.raises(NotDeterminedError, match="on 2 days; 5 days or more are needed"):
        calibrated([each for each in recorded if each.time_s[0] < 2 * 86_400.0], believed(crane))
    turned = [replace(each, raw_g=each.raw_g @ np.diag([1.0, 1.0, 0.5])) for each in recorded]
    with pytest.raises(InputError, match=r"reads 0\.51 g; check device\.axes_map"):
        calibrated(turned, believed(crane))


PERIOD_S = 2 * np.pi * np.sqrt(12.0 / G_M_S2)
TIME_S = np.arange(0.0, 7 * PERIOD_S, 1 / RATE_HZ)


def swing(amplitude_rad: float = 0.08, phase_rad: float | Values = 0.0) -> Values:
    angle = amplitude_rad * np.cos(2 * np.pi / PERIOD_S * TIME_S + phase_rad)
    rate = amplitude_rad * np.sin(2 * np.pi / PERIOD_S * TIME_S + phase_rad)
    force_g = np.column_stack([0.5 * np.sin(angle), 0 * angle, np.cos(angle) + 0.5 * rate**2])
    return np.asarray(force_g + 1e-4 * np.random.default_rng(1).standard_normal(force_g.shape))


def windows_of(force_g: Values, time_s: Values = TIME_S) -> list[bool]:
    finder = FreeMotionFinder(MountedHousing(length_m=12.0, position_m=6.0))
    return [
        window.is_swing
        for start in range(0, len(time_s), 50)
        for window in finder.feed(time_s[start : start + 50], force_g[start : start + 50])
    ]


def test_a_free_swing_and_a_rest_are_found_whatever_the_blocks() -> None:
    assert windows_of(swing()) == [True]
    assert windows_of(swing(0.0005)) == [False]


@pytest.mark.parametrize(
    ("what", "force_g"),
    [
        ("a hoist", swing(phase_rad=np.asarray(0.002 * TIME_S**2))),
        ("a trolley", swing() + np.where((TIME_S > 12) & (TIME_S < 14), 0.02, 0.0)[:, None] * [1.0, 0.0, 0.0]),
        ("a motion that grows", swing() * np.column_stack([1 + TIME_S / 200, 0 * TIME_S, 1 + 0 * TIME_S])),
        ("a bouncing load", swing() + 0.002 * np.sin(9 * TIME_S)[:, None] * [0.0, 0.0, 1.0]),
        ("a clipped reading", np.where(np.arange(len(TIME_S))[:, None] == 400, np.nan, swing())),
        ("a swing too small", swing(0.008)),
        ("a swing too wide", swing(0.4)),
    ],
)
def test_what_a_free_rope_does_not_do_is_left_out(what: str, force_g: Values) -> None:
    assert windows_of(force_g) == [], what


def test_a_gap_and_a_swing_shorter_than_a_window_are_left_out() -> None:
    assert windows_of(swing(), TIME_S + np.where(TIME_S > 20, 10.0, 0.0)) == []
    assert windows_of(swing()[:600], TIME_S[:600]) == []
