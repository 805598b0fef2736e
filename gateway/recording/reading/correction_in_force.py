"""The configuration and the correction that were in force in a recording."""

from dataclasses import replace
from typing import Any

from devices.axes_map import SAME_AXES, AxesMap, parse_axes_map
from devices.errors import RecordingError
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.store import parse_record
from gateway.configuration.loading import validate
from gateway.configuration.model import Configuration
from gateway.file_input import parse_toml
from gateway.messages import Calibration
from gateway.recording.reading.recording_file import RecordingFile


def recorded_correction(file: RecordingFile, message: Calibration | None, axes: AxesMap | None = None) -> Correction:
    """Return the correction of a calibration message, by the device of a file and its axes; `axes` may take their place.

    A factory record is in the device. Raises `RecordingError` for what the file states, and `CalibrationError` for a damaged
    record.
    """
    device = file.device()
    if axes is None:
        axes = recorded_axes(file)
    if message is not None and message.status == "calibrated":
        return correction_for(device, axes, parse_record(message.record, device.device_id, str(file.path)))
    if message is not None and message.status == "uncalibrated":
        device = replace(device, factory_calibration=None)  # the gateway did not use the factory's either
    return correction_for(device, axes, None)


def recorded_axes(file: RecordingFile) -> AxesMap:
    """Return the axes of the device in a recording, whatever else its configuration has. Raises `RecordingError`."""
    device = (_recorded_table(file) or {}).get("device")
    text = device.get("axes_map") if isinstance(device, dict) else None
    if text is None:
        return SAME_AXES
    try:
        return parse_axes_map(str(text))
    except ValueError as error:
        raise RecordingError(f"{file.path}: its configuration: device.axes_map {error}") from error


def recorded_configuration(file: RecordingFile) -> Configuration | None:
    """Return the configuration in a recording; None: it has none.

    Raises `RecordingError`, and `ConfigurationError` where it is not valid.
    """
    table = _recorded_table(file)
    return None if table is None else validate(table, f"{file.path}: its configuration")


def _recorded_table(file: RecordingFile) -> dict[str, Any] | None:
    if file.configuration_toml is None:
        return None
    try:
        return parse_toml(file.configuration_toml)
    except ValueError as error:
        raise RecordingError(f"{file.path}: its configuration is not TOML: {error}") from error
