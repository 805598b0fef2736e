"""Recordings of a gateway, written through its own recorder."""

from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from gateway.numerics.array import Array
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS

BLOCK_SAMPLES = 50


def write_mcap(
    path: Path,
    device: DeviceInfo,
    raw: Array,
    *,
    temperature_c: Array | None = None,
    begin_s: float = 0.0,
    sensor: str = "hook",
    configuration_toml: str = "",
) -> Path:
    """Write the readings of a device at its nominal rate, shape (n, 3), with a temperature for each, shape (n,)."""
    header = RecordingHeader("0.1.0", "yard", "crane-2", sensor, "b00t", configuration_toml)
    folder = path.parent / f"{path.stem}-segments"
    folder.mkdir()
    recorder = Recorder(folder, header, segment_s=1e6, fsync_s=1e6, quota_mb=1000.0)
    time_ns = START_NS + np.rint((begin_s + np.arange(len(raw)) / device.odr_hz) * 1e9).astype(np.int64)
    recorder.set_device(device, int(time_ns[0]))
    segment = recorder.start(int(time_ns[0]))
    readings = np.rint(raw).astype(np.int32) if device.unit == "counts" else raw
    for sequence, start in enumerate(range(0, len(raw), BLOCK_SAMPLES)):
        part = slice(start, start + BLOCK_SAMPLES)
        mean_c = None if temperature_c is None else float(np.mean(temperature_c[part]))
        block = SampleBlock(time_ns[part], readings[part], temperature_c=mean_c)
        last_ns = int(block.time_ns[-1])
        message = pack(block, time_ns=last_ns, clock="synchronised", sequence=sequence, calibration_id=None)
        recorder.write(encode_message("samples", message, last_ns))
    recorder.close()
    return segment.rename(path)
