"""The device of a configured replay: the recording, its columns and its calibration."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.foreign import NOTHING_STATED, TableOptions, is_native, read_foreign_table
from devices.tables.native import read_table
from devices.tables.replay import Replay, table_info
from gateway.configuration.device_sections import ReplayDevice
from gateway.recording.reading.samples import SampleReader
from gateway.recording.reading.timeline import Timeline, open_timeline

log = logging.getLogger("plumbline.device")


def open_replay(device: ReplayDevice, block_samples: int, clock: Clock) -> Replay:
    """Return the recording as a device. Raises `RecordingError` where it cannot be read."""
    if device.path.suffix == ".mcap":
        parts = _RecordedParts(open_timeline([device.path]))
        return Replay(parts, parts.info(), clock=clock, speed=device.speed, block_samples=block_samples)
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
    return Replay([recording], info, clock=clock, speed=device.speed, block_samples=block_samples)


@dataclass(frozen=True, slots=True)
class _RecordedParts:
    """The samples of a recording of the gateway, read part by part, anew at each iteration."""

    timeline: Timeline

    def info(self) -> DeviceInfo:
        """Return the device of the recording, with the calibration in force at its start. Raises `RecordingError`."""
        reader = SampleReader(self.timeline)
        if next(reader.recordings(), None) is None:
            raise RecordingError(f"{self.timeline.name}: has a single sample; choose a longer recording")
        info = replace(reader.device, kind="replay", can_wait=True)
        record = reader.calibrations[0].message.record if reader.calibrations else None
        return replace(info, factory_calibration=record) if record else info

    def __iter__(self) -> Iterator[Recording]:
        try:
            yield from SampleReader(self.timeline).recordings()
        except RecordingError as error:  # a device that fails is opened again, and the replay would begin anew
            log.error("%s; the replay ends here", error)


def _options(device: ReplayDevice) -> TableOptions:
    columns = None
    if device.axis_columns is not None:
        x, y, z = device.axis_columns
        columns = x, y, z
    return TableOptions(device.unit, columns, device.time_column, device.rate_hz, device.units_per_g)
