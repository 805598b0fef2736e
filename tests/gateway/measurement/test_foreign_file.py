"""Recordings of other programs in `measure`: MATLAB files, counts, gravity, and the options of the command line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from devices.errors import RecordingError
from devices.tables.foreign import NOTHING_STATED, TableOptions
from gateway.cli.main import main
from gateway.errors import InputError
from gateway.measurement.foreign_file import read_foreign
from gateway.measurement.source import UNALIGNED_MOUNT_U_DEG, UNCALIBRATED_NORM_ERROR_G, read_source

RATE_HZ = 100.0
GRAVITY = 9.80665


def swing_g(count: int = 4000, amplitude_deg: float = 5.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and the specific force at three quarters of a rope of 4 m, for small angles."""
    time_s = np.arange(count) / RATE_HZ
    angle = np.radians(amplitude_deg) * np.cos(np.sqrt(GRAVITY / 4) * time_s)
    rate2 = np.radians(amplitude_deg) ** 2 * GRAVITY / 4 * np.sin(np.sqrt(GRAVITY / 4) * time_s) ** 2
    lateral = -np.sin(angle) * (1 - 0.75)
    along = np.cos(angle) + 0.75 * 4 * rate2 / GRAVITY
    noise = np.random.default_rng(1).normal(0, 1e-3, (count, 3))
    return time_s, np.column_stack([lateral, np.zeros(count), along]) + noise


def write_rig(folder: Path) -> Path:
    path = folder / "rig.toml"
    path.write_text("[rope]\nlength_m = 4.0\n[housing]\nposition_m = 3.0\n[sensor]\nnoise_g = 0.001\n")
    return path


def test_arrays_of_a_matlab_file_are_read_by_their_names(tmp_path: Path) -> None:
    time_s, force_g = swing_g(400)
    savemat(tmp_path / "log.mat", {"t": time_s, "acc": force_g * GRAVITY, "note": "bench", "gain": 3.0})
    recording, findings = read_foreign(tmp_path / "log.mat", NOTHING_STATED)
    np.testing.assert_allclose(recording.raw, force_g, rtol=1e-12)
    assert recording.rate_hz == pytest.approx(RATE_HZ)
    assert findings[0] == "axes x, y, z: columns acc_x, acc_y, acc_z"


def test_fields_of_a_matlab_structure_and_rows_are_columns(tmp_path: Path) -> None:
    time_s, force_g = swing_g(400)
    savemat(
        tmp_path / "log.mat", {"data": {"time": time_s, "imu": np.vstack([force_g.T, force_g.T])}, "short": np.ones(9)}
    )
    options = TableOptions(columns=("data_imu_4", "data_imu_5", "data_imu_6"), time="data_time", unit="g")
    recording, _ = read_foreign(tmp_path / "log.mat", options)
    np.testing.assert_allclose(recording.raw, force_g, rtol=1e-12)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"", "is no MATLAB file"),
        (b"MATLAB 5.0 MAT-file, cut", "is no MATLAB file"),
        (b"t,x\n1,2\n", "is no MATLAB file"),
    ],
)
def test_what_is_no_matlab_file_is_refused(tmp_path: Path, content: bytes, fault: str) -> None:
    (tmp_path / "bad.mat").write_bytes(content)
    with pytest.raises(InputError, match=fault):
        read_foreign(tmp_path / "bad.mat", NOTHING_STATED)


def test_a_missing_matlab_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.mat: no such file"):
        read_foreign(tmp_path / "none.mat", NOTHING_STATED)


def test_a_fault_of_the_table_names_the_matlab_file(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"p": np.ones(50), "q": np.ones(50)})
    with pytest.raises(RecordingError, match=r"log\.mat: .*which columns are the axes|log\.mat: "):
        read_foreign(tmp_path / "log.mat", NOTHING_STATED)


def test_readings_without_gravity_are_refused(tmp_path: Path) -> None:
    time_s, force_g = swing_g(400)
    rows = np.column_stack([time_s, force_g - [0, 0, 1] + np.sin(9 * time_s)[:, None]])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t_s,ax,ay,az", comments="")
    with pytest.raises(InputError, match="gravity was removed"):
        read_foreign(tmp_path / "log.csv", TableOptions(unit="g"))


def test_counts_need_their_sensitivity(tmp_path: Path) -> None:
    time_s, force_g = swing_g(400)
    rows = np.column_stack([time_s, np.rint(16384 * force_g)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t_s,ax_raw,ay_raw,az_raw", comments="", fmt="%.10g")
    with pytest.raises(InputError, match="is in counts; give --units-per-g"):
        read_foreign(tmp_path / "log.csv", NOTHING_STATED)
    recording, _ = read_foreign(tmp_path / "log.csv", TableOptions(units_per_g=16384))
    np.testing.assert_allclose(recording.raw, force_g, atol=1e-4)


def test_a_foreign_recording_has_the_uncertainty_of_an_uncalibrated_sensor(tmp_path: Path) -> None:
    time_s, force_g = swing_g(400)
    np.savetxt(tmp_path / "a.csv", np.column_stack([time_s, force_g]), delimiter=",", header="t,ax,ay,az", comments="")
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(tmp_path / "b.csv", np.column_stack([time_s, force_g]), delimiter=",", header=header, comments="")
    foreign, native = read_source([tmp_path / "a.csv"]), read_source([tmp_path / "b.csv"])
    np.testing.assert_array_equal(foreign.force_g, native.force_g)
    assert (foreign.permissible_norm_error_g, foreign.mount_u_deg) == (UNCALIBRATED_NORM_ERROR_G, UNALIGNED_MOUNT_U_DEG)
    assert foreign.permissible_norm_error_g > native.permissible_norm_error_g
    assert foreign.remarks[0] == "found: axes x, y, z: columns ax, ay, az"
    assert native.remarks == ()


@pytest.mark.slow
def test_measure_takes_a_turned_sensor_in_milliseconds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A phone that hangs with its y axis up: the housing's z is its y, the housing's y its -z."""
    time_s, force_g = swing_g()
    phone = np.column_stack([force_g[:, 0], force_g[:, 2], -force_g[:, 1]]) * GRAVITY
    path = tmp_path / "phone.csv"
    rows = np.column_stack([np.rint(1000 * time_s), phone])
    np.savetxt(
        path, rows, delimiter=";", header="stamp;accX;accY;accZ", comments="", fmt=["%d", "%.6f", "%.6f", "%.6f"]
    )
    rig = write_rig(tmp_path)
    assert main(["measure", str(path), "--rig", str(rig), "--axes", "x,-z,y", "--json", "-"]) == 0
    swing = json.loads(capsys.readouterr().out)["swing"]
    assert swing["coverage95_deg"][0] < 5.0 < swing["coverage95_deg"][1]


def test_a_clock_without_colons_and_rows_without_a_reading(tmp_path: Path) -> None:
    time_s, force_g = swing_g(1000)
    force_g[[300, 301, 700]] = 0.0
    lines = []
    for each_s, (x, y, z) in zip(time_s + 55.0, force_g, strict=True):
        clock = f"1617{each_s:07.4f}" if each_s < 60 else f"1618{each_s - 60:07.4f}"
        lines.append("\t".join([clock, *(f"{each:.5f}" for each in (x, y, z))]).replace(".", ","))
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    source = read_source([path], options=replace(NOTHING_STATED, columns=("2", "3", "4"), time="1:hms"))
    assert source.recording.rate_hz == pytest.approx(RATE_HZ)
    assert source.recording.time_s[[0, -1]].tolist() == pytest.approx([0.0, 9.99])
    assert (len(source.recording), source.recording.invalid) == (997, 3)
    assert any("3 rows are zero" in remark for remark in source.remarks)


def test_a_gateways_recording_takes_no_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.mcap").write_bytes(b"")
    assert main(["measure", str(tmp_path / "run.mcap"), "--unit", "g"]) == 2
    assert "states its own columns and units" in capsys.readouterr().err
