"""A recording as specific force in the housing frame, whatever its form."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.errors import RecordingError
from devices.recording import Recording
from devices.table import read_table
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.store import parse_record
from gateway.configuration.loading import validate
from gateway.configuration.model import Configuration
from gateway.measurement.rig import Rig
from gateway.pipeline.mounting import mounted_housing, with_sensor
from gateway.recording.run import RecordedRun, read_samples
from gateway.swing.rig import MountedHousing

AXES_AS_THEY_ARE = ((0, 1), (1, 1), (2, 1))


@dataclass(frozen=True, slots=True)
class Source:
    """What `measure` takes."""

    path: Path
    recording: Recording
    force_g: NDArray[np.float64]
    """Specific force in the housing frame, shape (n, 3)."""
    permissible_norm_error_g: float
    calibration: str
    noise_g: float | NDArray[np.float64] | None = None
    full_scale_g: float | None = None
    housing: MountedHousing | None = None
    """As the recording's own configuration has it."""
    correction: Correction | None = None
    """Calibration behind `force_g`, with the uncertainty that it has at the recording's temperatures; None: as recorded."""
    bandwidth_hz: float | None = None
    """Of the low-pass inside the sensor."""
    remarks: tuple[str, ...] = ()
    """What makes the uncertainty larger."""


def read_source(path: Path, rig: Rig | None = None) -> Source:
    """Read `.mcap` of the gateway or `.csv`; what a rig says wins over what the recording brings.

    Raises `RecordingError` or `InputError` with the place and the mend.
    """
    source = _from_run(path) if path.suffix == ".mcap" else _from_table(path)
    if rig is None:
        return source
    sensor = rig.sensor
    stated = np.array(sensor.noise_g) if isinstance(sensor.noise_g, list) else sensor.noise_g
    return replace(
        source,
        housing=_mounted(rig, source),
        noise_g=source.noise_g if stated is None else stated,
        full_scale_g=sensor.full_scale_g or source.full_scale_g,
    )


def _mounted(rig: Rig, source: Source) -> MountedHousing:
    """The place as the rig has it, the sensor as its calibration has it."""
    housing, bandwidth_hz = rig.mounted_housing(), rig.sensor.bandwidth_hz or source.bandwidth_hz
    if source.correction is None:
        return replace(housing, bandwidth_hz=bandwidth_hz)
    return with_sensor(housing, source.correction, bandwidth_hz)


def _from_table(path: Path) -> Source:
    recording = read_table(path)
    return Source(
        path=path,
        recording=recording,
        force_g=recording.raw,
        permissible_norm_error_g=0.01,
        calibration="as recorded",
    )


def _from_run(path: Path) -> Source:
    run = read_samples(path)
    configuration = _configuration(run)
    recording = run.recording()
    first = run.calibrations[0].message if run.calibrations else None
    stored = None  # a factory record comes with the device
    if first is not None and first.status == "calibrated":
        stored = parse_record(first.record, run.device.device_id, str(path))
    axes = AXES_AS_THEY_ARE if configuration is None else configuration.device.axes
    correction = correction_for(run.device, axes, stored)
    farthest_c = _farthest_c(recording, correction)
    widened = correction.widened_by(correction.kelvin_beyond(farthest_c))
    bandwidth_hz = run.device.bandwidth_hz
    return Source(
        path=path,
        recording=recording,
        force_g=correction.apply(recording.raw),
        permissible_norm_error_g=correction.permissible_norm_error_g,
        calibration=correction.text,
        noise_g=run.device.noise_g,
        full_scale_g=run.device.full_scale_g,
        housing=None if configuration is None else mounted_housing(configuration, widened, bandwidth_hz),
        correction=widened,
        bandwidth_hz=bandwidth_hz,
        remarks=correction.range_warnings(farthest_c),
    )


def _farthest_c(recording: Recording, correction: Correction) -> float | None:
    """The temperature of the recording that lies farthest beyond the calibration's."""
    if recording.temperature_c is None or not np.isfinite(recording.temperature_c).any():
        return None
    ends_c = float(np.nanmin(recording.temperature_c)), float(np.nanmax(recording.temperature_c))
    return max(ends_c, key=correction.kelvin_beyond)


def _configuration(run: RecordedRun) -> Configuration | None:
    if run.configuration_toml is None:
        return None
    try:
        return validate(tomllib.loads(run.configuration_toml), f"{run.path}: its configuration")
    except tomllib.TOMLDecodeError as error:
        raise RecordingError(f"{run.path}: its configuration is not TOML: {error}") from error
