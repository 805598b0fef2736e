"""The device of a configured replay: the recording, its layout and its calibration."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from devices.clock import Clock
from devices.errors import RecordingError
from devices.replay import Replay, table_info
from devices.table import NATIVE, TableLayout, read_table
from gateway.configuration.device_sections import ReplayDevice
from gateway.recording.run import read_samples


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
    layout = table_layout(device)
    recording = read_table(device.path, layout)
    info = replace(table_info(device.path, layout, recording), can_wait=True)
    return Replay(recording, info, clock=clock, speed=device.speed, block_samples=block_samples)


def table_layout(device: ReplayDevice) -> TableLayout:
    """Return the layout of a text recording. Raises `RecordingError` where that of a foreign one is described incompletely."""
    if device.axis_columns is None:
        return NATIVE
    if device.unit is None:
        raise RecordingError(
            f"{device.path}: device.axis_columns is given and device.unit is not; say g, m/s2 or counts"
        )
    x, y, z = (_column(name) for name in device.axis_columns)
    return TableLayout(
        axes=(x, y, z),
        unit=device.unit,
        time=None if device.time_column is None else _column(device.time_column),
        rate_hz=device.rate_hz,
        delimiter=_delimiter(device.path),
        units_per_g=device.units_per_g,
    )


def _column(name: str) -> str | int:
    """Return a column: a 1-based number where the text is one."""
    return int(name) if name.isdigit() else name


def _delimiter(path: Path) -> Literal[",", "\t", " "]:
    """Return the delimiter between columns: the first one of comma, tab and blank in the first lines."""
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError:
        return ","  # the reader reports what is wrong with the file
    found: tuple[Literal[",", "\t", " "], ...] = (",", "\t", " ")
    return next((delimiter for delimiter in found if delimiter.encode() in start), ",")
