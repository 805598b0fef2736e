"""The files of one gateway: their common settings, the calibration in force, and their raw readings for another calibration."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.foreign import NOTHING_STATED, TableOptions
from gateway.calibration.input_files import FileReadings, read_file
from gateway.configuration.model import Configuration
from gateway.errors import InputError
from gateway.messages import Calibration
from gateway.recording.reading.recording_file import RecordingFile
from gateway.recording.reading.sample_calibration import recorded_configuration
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


def calibration_in_force(run: RecordedSamples, recording: Recording) -> tuple[Calibration | None, tuple[str, ...]]:
    """Return the calibration in force at the first sample, and a remark if another one followed."""
    if not run.calibrations or recording.origin_ns is None:
        return None, ()
    first_ns, last_ns = (recording.origin_ns + round(float(recording.time_s[end]) * 1e9) for end in (0, -1))
    known = [calibration for calibration in run.calibrations if calibration.log_time_ns <= first_ns]
    later = [calibration for calibration in run.calibrations if first_ns < calibration.log_time_ns <= last_ns]
    in_force = known[-1] if known else run.calibrations[0]
    changes = [calibration for calibration in later if calibration is not in_force]
    if not changes:
        return in_force.message, ()
    change_s = (changes[0].log_time_ns - recording.origin_ns) / 1e9
    remark = f"another calibration came into force at {change_s:.3f} s and is not used; measure that part with --from"
    return in_force.message, (remark,)


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
