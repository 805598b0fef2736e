"""`plumbline calibrate thermal`: ramps to a record with a thermal model, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.bench.thermal.ramp_calibration import calibrate_ramps
from gateway.calibration.acceptance import make_record
from gateway.calibration.input_files import FileReadings
from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from gateway.measurement.source import read_source
from tests.gateway.bench.thermal_sensors import RATE_HZ, planted, ramps
from tests.recordings import write_mcap
from tests.values import present

pytestmark = pytest.mark.slow


def write(folder: Path, files: list[FileReadings], temperature: bool = True) -> list[Path]:
    paths = []
    for file in files:
        path = folder / file.path.name
        columns = [file.time_s[:, None], file.raw]
        names = f"time_s,ax_{file.unit.lower()},ay_{file.unit.lower()},az_{file.unit.lower()}"
        if temperature and file.temperature_c is not None:
            columns, names = [*columns, file.temperature_c[:, None]], f"{names},temperature_c"
        np.savetxt(path, np.hstack(columns), delimiter=",", header=names, comments="", fmt="%.6f")
        paths.append(path)
    return paths


def thermal(tmp_path: Path, *arguments: Any) -> tuple[int, CalibrationRecord | None]:
    out = tmp_path / "record.json"
    out.unlink(missing_ok=True)
    code = main(["calibrate", "thermal", *map(str, arguments), "--json", str(out)])
    return code, CalibrationRecord.model_validate(json.loads(out.read_text())) if out.exists() else None


def test_ramps_in_tables_give_a_record_a_certificate_and_verdicts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = write(tmp_path, ramps("ADXL335", np.random.default_rng(1), duration_s=120.0))
    page = tmp_path / "certificate.html"
    code, record = thermal(tmp_path, *files[::-1], "--part", "adxl335", "--device-id", "d", "--html", page)
    assert code == 1  # z exceeds the data sheet
    assert record is not None
    assert record.method == "thermal"
    assert record.thermal is not None
    assert record.thermal["reference_c"] == 25.0
    output = capsys.readouterr().out
    assert "limits of ADXL335" in output
    assert "z  offset       -3.6" in output
    assert "verdict: exceeds" in output
    certificate = page.read_text()
    assert "Zero-g offset against temperature" in certificate
    assert "Against the data sheet: x within, y within, z exceeds." in certificate


def test_recordings_of_the_gateway_are_ramps(tmp_path: Path) -> None:
    device = DeviceInfo(kind="adxl355", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=16384.0)
    paths = [
        write_mcap(tmp_path / f"{number}.mcap", device, file.raw, temperature_c=file.temperature_c)
        for number, file in enumerate(ramps("MPU-9255", np.random.default_rng(1), duration_s=120.0))
    ]
    code, record = thermal(tmp_path, *paths, "--limit-offset", 1.5)
    assert code == 0
    assert record is not None
    assert (record.device_id, record.unit) == ("part-7", "counts")


@pytest.mark.parametrize(
    ("options", "temperature", "code", "text"),
    [
        (["--part", "ABC"], True, 2, "--part ABC is not known"),
        ([], False, 2, "has no temperature"),
        (["--at-rest"], True, 2, "--at-rest needs --parent"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_no_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], temperature: bool, code: int, text: str
) -> None:
    files = write(tmp_path, ramps("ADXL335", np.random.default_rng(1), duration_s=60.0), temperature)
    assert thermal(tmp_path, *files, *options) == (code, None)
    err = capsys.readouterr().err
    assert text in err
    assert err.count("\n") == 1


def test_measure_applies_the_thermal_model_of_a_recording(tmp_path: Path) -> None:
    found = calibrate_ramps(ramps("MPU-9255", np.random.default_rng(8), duration_s=120.0))
    record = make_record(
        found.fit, device_id="part-7", unit="counts", software="0.1.0", by="bench",
        created_utc="2026-11-21T10:15:00Z", parent=None,
    )  # fmt: skip
    device = DeviceInfo(
        kind="mpu9250", device_id="part-7", unit="counts", odr_hz=RATE_HZ, units_per_g=16384.0,
        factory_calibration=record.model_dump(mode="json"),
    )  # fmt: skip
    zero_g, sensitivity, offset_mg, scale_percent = planted("MPU-9255")
    force_g = np.array([0.02, -0.01, 1.0])
    raw = zero_g + sensitivity * (force_g * (1 + scale_percent / 100 * 30) + offset_mg / 1000 * 30)
    path = write_mcap(tmp_path / "warm.mcap", device, np.tile(raw, (1200, 1)), temperature_c=np.full(1200, 55.0))
    np.testing.assert_allclose(read_source([path]).force_g.mean(axis=0), force_g, atol=5e-4)
    cold = write_mcap(tmp_path / "unknown.mcap", device, np.tile(raw, (1200, 1)))
    source = read_source([cold])
    assert source.temperature_warnings == ("widened: the temperature is not known, the thermal model is not applied",)
    assert present(source.correction).u_zero_g_offset_g[0] > 0.02
