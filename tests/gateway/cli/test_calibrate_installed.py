"""`plumbline calibrate installed`: weeks of recordings to a comparison and an offered record, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from tests.gateway.bench.intervals.service import wide_record
from tests.gateway.bench.planted.service import RATE_HZ, Installed, Weeks, weeks_of_service
from tests.recordings import write_mcap

CONFIGURATION = (
    "[rope]\nlength_m = 12.0\n[housing]\nabove_load_m = 6.5\nmount_u_deg = 0.57\n[device]\nkind = 'adxl355'\n"
)
CRANE = Installed(scale=np.array([0.015, -0.01, 0.0]), above_load_m=6.5, offset_g=np.array([0.02, 0.0, 0.0]))
DEVICE = DeviceInfo("test", "part-7", "g", odr_hz=RATE_HZ, units_per_g=1.0)


def write_weeks(
    folder: Path, weeks: Weeks, crane: Installed = CRANE, configuration: str = CONFIGURATION, sensor: str = "part-7"
) -> Path:
    """Write each swing and each rest as a recording of a gateway, and the record that was in force beside their folder."""
    folder.mkdir()
    device = DeviceInfo("test", sensor, "g", odr_hz=RATE_HZ, units_per_g=1.0)
    for number, each in enumerate(weeks_of_service(np.random.default_rng(1), crane, weeks)):
        write_mcap(
            folder / f"{number:03d}.mcap", device, each.raw_g, temperature_c=each.temperature_c,
            begin_s=float(each.time_s[0]), configuration_toml=configuration,
        )  # fmt: skip
    (folder.parent / "before.json").write_text(json.dumps(wide_record().model_dump(mode="json")))
    return folder


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_weeks(tmp_path_factory.mktemp("service") / "plumbline-data", Weeks(days=12, swings_a_day=2))


def calibrate(*arguments: Any) -> int:
    return main(["calibrate", "installed", *map(str, arguments)])


def test_weeks_of_recordings_give_a_table_an_offered_record_and_a_certificate(
    service: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    offered, page = tmp_path / "offered.json", tmp_path / "offered.html"
    arguments = ("--parent", service.parent / "before.json", "--json", offered, "--html", page)
    assert calibrate(service, *arguments) == 0
    output = capsys.readouterr().out
    assert "housing above the load" in output
    assert "is confirmed within these intervals" in output
    assert "not identifiable on the rope" in output
    assert "an offer: review it, then put it in force" in output
    record = CalibrationRecord.model_validate(json.loads(offered.read_text()))
    assert (record.method, record.device_id, record.parent) == ("installed", "part-7", wide_record().id)
    assert abs(record.correction_matrix[0][0] - 1 / 1.015) < 2 * record.u_scale_factor[0]
    assert abs(record.offset[0] - 0.02) < 2 * record.u_zero_g_offset_g[0]
    assert record.u_zero_g_offset_g[2] == pytest.approx(0.015)
    assert "Swings and rests on the rope" in page.read_text()


def test_a_rig_that_the_swings_contradict_is_named_with_exit_code_1(
    service: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crane = Installed(above_load_m=5.3)
    folder = write_weeks(tmp_path / "data", Weeks(days=12, swings_a_day=2), crane)
    assert calibrate(folder, "--parent", service.parent / "before.json") == 1
    output = capsys.readouterr().out
    assert "contradicted: housing above the load" in output
    assert "no record is offered" in output


SHORT = Weeks(days=2, swings_a_day=1)


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        ({}, 1, "5 days or more are needed"),
        ({"configuration": CONFIGURATION.replace("above_load_m = 6.5", "")}, 2, "does not state where the housing is"),
        ({"configuration": CONFIGURATION + "[x]"}, 2, "its configuration"),
        (
            {"configuration": CONFIGURATION.replace("mount_u_deg", "mounted_on = 'spreader'\nmount_u_deg")},
            2,
            "the housing is on spreader; only one on a single rope",
        ),
        ({"sensor": "part-8"}, 2, "belongs to part-7, not to part-8"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    options: dict[str, Any], code: int, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_weeks(tmp_path / "data", SHORT, **options)
    assert calibrate(folder, "--parent", tmp_path / "before.json") == code
    errors = capsys.readouterr().err
    assert text in errors
    assert errors.count("\n") == 1


def test_recordings_of_two_sensors_or_rigs_and_a_missing_parent_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_weeks(tmp_path / "data", SHORT)
    assert calibrate(folder) == 2
    assert "--parent FILE is needed" in capsys.readouterr().err
    later = np.zeros((100, 3))
    other = DeviceInfo("test", "part-8", "g", odr_hz=RATE_HZ, units_per_g=1.0)
    write_mcap(folder / "other.mcap", other, later, begin_s=5e5, configuration_toml=CONFIGURATION)
    assert calibrate(folder, "--parent", tmp_path / "before.json") == 2
    assert "has another device.device_id" in capsys.readouterr().err
    (folder / "other.mcap").unlink()
    moved = CONFIGURATION.replace("6.5", "7.5")
    write_mcap(folder / "moved.mcap", DEVICE, later, begin_s=5e5, configuration_toml=moved)
    assert calibrate(folder, "--parent", tmp_path / "before.json") == 2
    assert "another position of the housing" in capsys.readouterr().err
