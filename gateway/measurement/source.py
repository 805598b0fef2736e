"""A recording, from any supported file, as specific force in the housing frame."""

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

SENSOR_AXES = ((0, 1), (1, 1), (2, 1))
"""Axes map of a housing whose axes are those of the sensor."""


@dataclass(frozen=True, slots=True)
class Source:
    """The input of `measure`: specific force, with what is known of sensor and housing."""

    path: Path
    recording: Recording
    force_g: NDArray[np.float64]
    """Specific force in the housing frame, shape (n, 3)."""
    permissible_norm_error_g: float
    calibration: str
    noise_g: float | NDArray[np.float64] | None = None
    full_scale_g: float | None = None
    housing: MountedHousing | None = None
    """From the rig, or from the configuration in the recording; None: the position is not known."""
    correction: Correction | None = None
    """Correction applied to the readings, its uncertainty widened for the recording's temperatures; None: none was applied."""
    bandwidth_hz: float | None = None
    """Bandwidth of the low-pass inside the sensor."""
    temperature_warnings: tuple[str, ...] = ()
    """Temperatures outside those of the calibration, which widen the uncertainty."""


def read_source(path: Path, rig: Rig | None = None) -> Source:
    """Read an `.mcap` of the gateway or a `.csv`; values of a rig replace those of the recording.

    Raises `RecordingError` or `InputError` with the place and the remedy.
    """
    source = _from_run(path) if path.suffix == ".mcap" else _from_table(path)
    if rig is None:
        return source
    sensor = rig.sensor
    stated = np.array(sensor.noise_g) if isinstance(sensor.noise_g, list) else sensor.noise_g
    return replace(
        source,
        housing=_mounted_housing(rig, source),
        noise_g=source.noise_g if stated is None else stated,
        full_scale_g=sensor.full_scale_g or source.full_scale_g,
    )


def _mounted_housing(rig: Rig, source: Source) -> MountedHousing:
    """Return the housing at the position of the rig, with the uncertainties of the sensor's calibration."""
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
    stored = None  # `run.device` contains the factory record
    if first is not None and first.status == "calibrated":
        stored = parse_record(first.record, run.device.device_id, str(path))
    axes = SENSOR_AXES if configuration is None else configuration.device.axes
    correction = correction_for(run.device, axes, stored)
    extreme_c = _extreme_temperature_c(recording, correction)
    widened = correction.widened_by(correction.kelvin_beyond(extreme_c))
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
        temperature_warnings=correction.range_warnings(extreme_c),
    )


def _extreme_temperature_c(recording: Recording, correction: Correction) -> float | None:
    """Return the temperature of the recording that is farthest outside those of the calibration."""
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
