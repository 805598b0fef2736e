"""The device of a configured replay: the recording, its columns and its calibration."""

import logging
from dataclasses import replace

from devices.clock import Clock
from devices.foreign_table import NOTHING_STATED, TableOptions, is_native, read_foreign_table
from devices.replay import Replay, table_info
from devices.table import read_table
from gateway.configuration.device_sections import ReplayDevice
from gateway.recording.run import read_samples

log = logging.getLogger("plumbline.device")


def open_replay(device: ReplayDevice, block_samples: int, clock: Clock) -> Replay:
    """Return the recording as a device. Raises `RecordingError` where it cannot be read."""
    if device.path.suffix == ".mcap":
        run = read_samples(device.path)
        info = replace(run.device, kind="replay", can_wait=True)
        if run.calibrations and run.calibrations[0].message.record:
            info = replace(
                info, factory_calibration=run.calibrations[0].message.record
            )  # the calibration of the recording
        return Replay(run.recording(), info, clock=clock, speed=device.speed, block_samples=block_samples)
    options = _options(device)
    if options == NOTHING_STATED and is_native(device.path):
        recording = read_table(device.path)
        info = table_info(device.path, recording, housing_frame=True)
    else:
        table = read_foreign_table(device.path, options)
        if table.findings:
            log.info("%s: %s", device.path, "; ".join(table.findings))
        recording = table.recording
        info = table_info(device.path, recording, units_per_g=device.units_per_g)
    return Replay(recording, info, clock=clock, speed=device.speed, block_samples=block_samples)


def _options(device: ReplayDevice) -> TableOptions:
    columns = None
    if device.axis_columns is not None:
        x, y, z = device.axis_columns
        columns = x, y, z
    return TableOptions(device.unit, columns, device.time_column, device.rate_hz, device.units_per_g)
