"""The correction that was in force in a recording: by its device, its axes and its calibration messages."""

from dataclasses import replace

from devices.axes_map import AxesMap
from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.store import parse_record
from gateway.configuration.loading import validate
from gateway.configuration.model import Configuration
from gateway.file_input import parse_toml
from gateway.messages import Calibration


def correction_of(message: Calibration | None, device: DeviceInfo, axes: AxesMap, place: str) -> Correction:
    """Return the correction of a calibration message; `place` is that of its record, for errors.

    A factory record is in `device`. Raises `CalibrationError` for a damaged record.
    """
    if message is not None and message.status == "calibrated":
        return correction_for(device, axes, parse_record(message.record, device.device_id, place))
    if message is not None and message.status == "uncalibrated":
        device = replace(device, factory_calibration=None)  # the gateway did not use the factory's either
    return correction_for(device, axes, None)


def parse_configuration(toml: str, place: str) -> Configuration:
    """Return the configuration of a recording. Raises `RecordingError`, and `ConfigurationError` where it is not valid."""
    try:
        table = parse_toml(toml)
    except ValueError as error:
        raise RecordingError(f"{place}: its configuration is not TOML: {error}") from error
    return validate(table, f"{place}: its configuration")
