"""Tables of other programs: their columns, units and times are found, or stated."""

from pathlib import Path

import numpy as np
import pytest

from devices.axes_map import parse_axes_map
from devices.errors import RecordingError
from devices.tables.columns import find_temperature, find_time, find_triples, is_acceleration, parse_name
from devices.tables.foreign import NOTHING_STATED, ForeignRecording, TableOptions, is_native, read_foreign_table
from tests.devices.tables.table_lines import WriteTable

GRAVITY = 9.80665


def rows(count: int, step: float, readings: str, form: str = "{:g}") -> list[str]:
    return [f"{form.format(number * step)}{readings}" for number in range(count)]


def read(path: Path, **stated: object) -> ForeignRecording:
    return read_foreign_table(path, TableOptions(**stated))  # type: ignore[arg-type]


PHYPHOX = '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"'
EXPORTS = {
    "phyphox, comma": [PHYPHOX, *rows(50, 0.01, f",0.0,0.0,{GRAVITY}", "{:.9E}")],
    "phyphox, tab": [PHYPHOX.replace(",", "\t"), *rows(50, 0.01, f"\t0.0\t0.0\t{GRAVITY}")],
    "phyphox, semicolon and decimal comma": [
        PHYPHOX.replace(",", ";"),
        *(row.replace(".", ",") for row in rows(50, 0.01, f";0.0;0.0;{GRAVITY}", "{:.2f}")),
    ],
    "phyphox, tab and decimal comma": [
        PHYPHOX.replace(",", "\t"),
        *(row.replace(".", ",") for row in rows(50, 0.01, f"\t0.0\t0.0\t{GRAVITY}", "{:.2f}")),
    ],
    "Sensor Logger": [
        "time,seconds_elapsed,z,y,x",
        *(f"{1698501144401935600 + number * 10_000_000},{number * 0.01},{GRAVITY},0,0" for number in range(50)),
    ],
    "WitMotion": [
        "Time(s) ax(g) ay(g) az(g) wx(deg/s) wy(deg/s) wz(deg/s) T(°C)",
        *rows(50, 0.01, " 0.0 0.0 1.0 1 2 3 25"),
    ],
    "headings in German": [
        "Zeit (ms);Beschleunigung X (g);Beschleunigung Y (g);Beschleunigung Z (g)",
        *rows(50, 10, ";0;0;1"),
    ],
    "integer milliseconds and milli-g": ["timestamp,accX,accY,accZ", *rows(50, 10, ",0,0,1000")],
    "microseconds of a controller": ["micros_us,AX,AY,AZ", *rows(50, 10_000, ",0,0,1")],
    "dates with times": [
        "Date;a_x;a_y;a_z",
        *(f"2024-05-01 12:00:{number / 100:05.2f};0;0;{GRAVITY}" for number in range(50)),
    ],
    "times of day": ["time,ax,ay,az", *(f"23:10:{number / 100:05.2f},0,0,1" for number in range(50))],
    "blanks between bare numbers": rows(50, 0.01, "   0.0   0.0  1.0", "  {:.2f}"),
    "a line of units below the names": ["t,ax,ay,az", "s,m/s^2,m/s^2,m/s^2", *rows(50, 0.01, f",0,0,{GRAVITY}")],
    "remarks above the header": ["# logger 3.1", "rate;100", "time_s,ax,ay,az", *rows(50, 0.01, ",0,0,1")],
    "magnetometer and gyroscope beside it": [
        "t_s,mag_x,mag_y,mag_z,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z",
        *rows(50, 0.01, ",30,40,50,1,2,3,0,0,1"),
    ],
}


@pytest.mark.parametrize("export", EXPORTS)
def test_exports_of_other_programs_are_understood(table: WriteTable, export: str) -> None:
    path = table(*EXPORTS[export])
    assert not is_native(path)
    found = read_foreign_table(path, NOTHING_STATED)
    assert found.recording.rate_hz == pytest.approx(100.0, rel=1e-4)
    np.testing.assert_allclose(found.recording.raw, [[0, 0, 1]] * 50, atol=1e-6)
    assert found.recording.unit == "g"


def test_what_was_found_is_said(table: WriteTable) -> None:
    found = read(table(*EXPORTS["integer milliseconds and milli-g"]))
    assert found.unit == "mg"
    assert found.findings == (
        "axes x, y, z: columns accX, accY, accZ",
        "unit mg, by the median magnitude 1000",
        "timestamp: time in ms",
    )


def test_what_is_stated_is_not_searched_for(table: WriteTable) -> None:
    path = table("ms,p,q,r", *rows(20, 10, ",0,0,2"))
    found = read(path, columns=("p", "q", "r"), unit="g", time="ms:ms")
    assert found.findings == ()
    assert found.recording.rate_hz == pytest.approx(100)
    np.testing.assert_array_equal(found.recording.raw[0], [0, 0, 2])


def test_two_columns_are_x_and_z_of_a_plane(table: WriteTable) -> None:
    path = table(*[f"{1000 + row}\t{16 * row}\t{20 * row}" for row in range(20)])
    found = read(path, columns=("2", "1"), unit="mg", time="3:ms")
    np.testing.assert_allclose(found.recording.raw[:2], [[0.0, 0.0, 1.0], [0.016, 0.0, 1.001]])


def test_columns_by_number_and_a_sample_counter(table: WriteTable) -> None:
    path = table("n,p,q,r", *rows(20, 1, ",0,0,16384"))
    found = read(path, columns=("2", "3", "4"), unit="counts", time="1", rate_hz=50.0)
    assert found.recording.rate_hz == pytest.approx(50)
    assert found.recording.unit == "counts"


def test_rows_of_lists_in_brackets_are_read(table: WriteTable) -> None:
    lines = [f"[0.1, 0.2, 9.8]; [1.5, -0.5, 5.1]; {row / 100:.6f}" for row in range(20)]
    found = read(table(*lines), columns=("1", "2", "3"), unit="m/s2", time="7")
    assert found.recording.rate_hz == pytest.approx(100)
    np.testing.assert_allclose(found.recording.raw, [[0.1 / 9.80665, 0.2 / 9.80665, 9.8 / 9.80665]] * 20)


def test_gyroscope_and_temperature_are_found_with_their_units(table: WriteTable) -> None:
    path = table("time_s,ax_g,ay_g,az_g,gx_rad/s,gy_rad/s,gz_rad/s,temp (°C)", *rows(20, 0.01, ",0,0,1,0,0,1,21.5"))
    recording = read(path).recording
    assert recording.gyro_dps is not None
    assert recording.temperature_c is not None
    np.testing.assert_allclose(recording.gyro_dps[0], [0, 0, np.degrees(1)])
    assert recording.temperature_c[0] == 21.5


def test_axes_turn_readings_and_rates_into_the_housing(table: WriteTable) -> None:
    path = table("time_s,ax_g,ay_g,az_g,gx_dps,gy_dps,gz_dps", *rows(20, 0.01, ",0,1,0,1,2,3"))
    recording = read(path, axes=parse_axes_map("x,-z,y")).recording
    assert recording.gyro_dps is not None
    np.testing.assert_array_equal(recording.raw[0], [0, 0, 1])
    np.testing.assert_array_equal(recording.gyro_dps[0], [1, -3, 2])


@pytest.mark.parametrize(
    ("lines", "stated", "fault"),
    [
        (
            [PHYPHOX.replace("Acc", "Linear Acc"), *rows(9, 0.01, ",0,0,1")],
            {},
            "gravity was removed from its columns Linear Acceleration x",
        ),
        (
            ["t,acc1_x,acc1_y,acc1_z,acc2_x,acc2_y,acc2_z", *rows(9, 0.01, ",0,0,1,0,0,1")],
            {},
            "several triples of axes (acc1_x, acc1_y, acc1_z; acc2_x, acc2_y, acc2_z); name one with --columns",
        ),
        (["t,p,q,r", *rows(9, 0.01, ",0,0,1")], {}, "which columns are the axes? give --columns X,Y,Z"),
        (["ax,ay,az", "0,0,1", "0,0,1"], {}, "no time column; give --rate HZ, or --time COLUMN"),
        (["t,ax,ay,az", *rows(9, 0.01, ",0,0,3.2")], {}, "in which unit are its readings (|m| about 3.2)? give --unit"),
        (["t,ax,ay,az", *rows(9, 0.5, ",0,0,1")], {"time": "t:h"}, "--time: h is no unit of time"),
        (["t,ax,ay,az", *rows(9, 0.01, ",0,0,1")], {"time": "u"}, "--time: there is no column u; it has t, ax, ay, az"),
        (["t,ax,ay,az", *rows(9, 0.01, ",0,0,1")], {"columns": ("1", "2", "9")}, "--columns: there is no column 9"),
        (["n,ax,ay,az", *rows(9, 1, ",0,0,1")], {"time": "n"}, "say what one second is, with --time n:ms"),
        (["t,ax,ay,az", "noon,0,0,1", "noon,0,0,1"], {}, "t: 'noon' is no time; give --time COLUMN"),
        (["only words", "and more words"], {}, "no header with the columns"),
        (
            ["time_s,ax_g,ay_g,az_g", "0.00,0.01,0.02,0.99", "0.01,0.01,0.02,0.98"],
            {"unit": "counts"},
            "--unit counts contradicts its columns, in g; leave --unit out",
        ),
    ],
)
def test_what_cannot_be_understood_is_refused_with_the_option_that_helps(
    table: WriteTable, lines: list[str], stated: dict[str, object], fault: str
) -> None:
    path = table(*lines)
    with pytest.raises(RecordingError) as refusal:
        read(path, **stated)
    assert str(refusal.value).startswith(f"{path}: ")
    assert fault in str(refusal.value)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        read(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("name", "words", "unit"),
    [
        ("Acceleration x (m/s^2)", ("acceleration", "x"), "m/s^2"),
        ("accX [mg]", ("acc", "x"), "mg"),
        ("ax_g", ("a", "x"), "g"),
        ("ACCZ", ("acc", "z"), ""),
        ("seconds_elapsed", ("seconds", "elapsed"), ""),
        ("time_ms", ("time",), "ms"),
        ("acc_x_m_s2", ("acc", "x"), "m s2"),
        ("x", ("x",), ""),
    ],
)
def test_names_are_split_into_words_and_unit(name: str, words: tuple[str, ...], unit: str) -> None:
    parsed = parse_name(name)
    assert (parsed.words, parsed.unit) == (words, unit)


def test_a_triple_of_angles_is_no_acceleration() -> None:
    names = ["t", "angle_x", "angle_y", "angle_z", "f_x", "f_y", "f_z", "temperature"]
    assert [is_acceleration(triple) for triple in find_triples(names)] == [False, True]
    assert (find_time(names), find_temperature(names)) == (0, 7)
