"""Readings for a calibration, from any supported file: raw, as the device delivered them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from devices.tables.foreign import NOTHING_STATED, TableOptions
from gateway.calibration.offline.input_files import FileReadings, read_file
from gateway.errors import InputError
from gateway.recording.reading.samples import read_samples
from gateway.recording.reading.timeline import list_recordings


def read_calibration_readings(paths: Sequence[Path], options: TableOptions) -> list[FileReadings]:
    """Return the readings of each `.csv`, and those of all `.mcap` files of one gateway as one file.

    A folder stands for its `.mcap` files. Raises `RecordingError` or `InputError` with the file and the
    remedy.
    """
    files = list_recordings(paths)
    runs = [path for path in files if path.suffix == ".mcap"]
    tables = [read_file(path, options) for path in files if path.suffix != ".mcap"]
    return tables if not runs else [*tables, _read_run(runs, options)]


def _read_run(paths: Sequence[Path], options: TableOptions) -> FileReadings:
    if replace(options, units_per_g=None) != NOTHING_STATED:
        raise InputError(
            f"{paths[0]}: states its own unit, columns and times; leave --columns, --unit, --time, --axes, --rate out"
        )
    run = read_samples(paths)
    recording = run.recording()
    return FileReadings(
        path=paths[0],
        unit=run.device.unit,
        time_s=recording.time_s,
        raw=recording.raw,
        temperature_c=recording.temperature_c,
        n_skipped=recording.invalid + recording.repeated + recording.backward,
        unit_is_stated=True,
        units_per_g=run.device.units_per_g,
        device_id=run.device.device_id,
    )
