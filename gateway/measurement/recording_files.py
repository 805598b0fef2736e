"""The files of one gateway: their common settings, the calibration in force, and their raw readings for another calibration."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from devices.axes_map import AxesMap
from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.foreign import NOTHING_STATED, TableOptions
from gateway.calibration.correction import Correction
from gateway.calibration.input_files import FileReadings, read_file
from gateway.configuration.model import Configuration
from gateway.errors import InputError
from gateway.recording.reading.recording_file import RecordingFile
from gateway.recording.reading.sample_calibration import recorded_configuration, recorded_correction
from gateway.recording.reading.samples import RecordedSamples, read_samples
from gateway.recording.reading.timeline import list_recordings


def common_configuration(files: Sequence[RecordingFile], *, same_rig: bool) -> Configuration | None:
    """Return the configuration of the first file.

    Raises `RecordingError` where another file has other axes, or, with `same_rig`, another rope, housing or gravity.
    """
    first, *others = (recorded_configuration(each) for each in files)
    for file, other in zip(files[1:], others, strict=True):
        settings = _settings(other, same_rig=same_rig)
        for name, value in _settings(first, same_rig=same_rig).items():
            if settings.get(name) != value:
                raise RecordingError(
                    f"{file.path}: was recorded with another {name} than {files[0].path}; measure them one by one"
                )
    return first


def _settings(configuration: Configuration | None, *, same_rig: bool) -> dict[str, object]:
    """Return the settings that all files of one recording must share."""
    if configuration is None:
        return {"configuration": None}
    settings: dict[str, object] = {"configuration": "recorded", "device.axes_map": configuration.device.axes}
    rig: dict[str, object] = {
        "rope.length_m": configuration.rope.length_m,
        "position of the housing": configuration.housing,
        "gravity": configuration.site.local_gravity_m_s2,
    }
    return settings | rig if same_rig else settings


def corrections_in_force(run: RecordedSamples, recording: Recording, axes: AxesMap) -> list[tuple[slice, Correction]]:
    """Return the correction of each part of a recording, by the calibration that was in force there.

    Raises `RecordingError`, and `CalibrationError` for a damaged record.
    """
    sample_ns = (recording.origin_ns or 0) + np.rint(recording.time_s * 1e9).astype(np.int64)
    stated_ns = np.array([each.log_time_ns for each in run.calibrations], dtype=np.int64)
    starts = np.where(stated_ns <= sample_ns[0], 0, np.searchsorted(sample_ns, stated_ns, "right")).tolist()
    in_force = {start: each.message for start, each in zip(starts, run.calibrations, strict=True)}
    first = in_force.pop(0, run.calibrations[0].message if run.calibrations else None)
    found: list[tuple[int, Correction]] = []
    for start, message in ((0, first), *in_force.items()):
        if start < len(recording):
            correction = recorded_correction(run.files[0], message, axes)
            if not found or correction.text != found[-1][1].text:
                found.append((start, correction))
    stops = [*(start for start, _ in found[1:]), len(recording)]
    return [(slice(start, stop), correction) for (start, correction), stop in zip(found, stops, strict=True)]


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
    return readings_of(read_samples(paths), paths[0])


def readings_of(run: RecordedSamples, path: Path) -> FileReadings:
    """Return raw samples as the readings of a file. Raises `RecordingError` for fewer than two."""
    recording = run.recording()
    return FileReadings(
        path=path,
        unit=run.device.unit,
        time_s=recording.time_s,
        raw=recording.raw,
        temperature_c=recording.temperature_c,
        n_skipped=recording.invalid + recording.repeated + recording.backward,
        unit_is_stated=True,
        units_per_g=run.device.units_per_g,
        device_id=run.device.device_id,
    )
