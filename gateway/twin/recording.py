"""Simulated recordings as files: CSV, or MCAP through the pipeline and the recorder of the gateway."""

import tempfile
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from gateway import __version__
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import to_toml, validate
from gateway.configuration.model import Configuration
from gateway.errors import InputError
from gateway.pipeline.incidents import IncidentRegister
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from gateway.topics import TOPICS
from gateway.twin.model import TwinRig
from gateway.twin.simulation import Simulated

START_NS = 1_735_689_600_000_000_000
"""The time of the first sample of every simulated recording. Definition: 2025-01-01T00:00:00Z."""
BLOCK_SAMPLES = 32
"""Samples in a block. Basis: as a device's, `device_factory.MAX_BLOCK_SAMPLES`."""
ONE_SEGMENT_S, QUOTA_MB = 1e7, 1e6
"""Limits of the recorder that are never reached. Basis: a choice; it then writes one file."""
CLOCK = ClockState("replayed", 0)
BOOT_ID = "simulated"


def as_csv(simulated: Simulated) -> str:
    """Return the recording as text, with one row per sample."""
    rows = np.column_stack([simulated.time_s, simulated.force_g, simulated.temperature_c]).tolist()
    lines = [f"{t:.6f},{x:.7f},{y:.7f},{z:.7f},{warm:.3f}" for t, x, y, z, warm in rows]
    return "\n".join(["time_s,ax_g,ay_g,az_g,temperature_c", *lines, ""])


def write_mcap(path: Path, rig: TwinRig, simulated: Simulated, seed: int) -> None:
    """Write the recording and all messages that the pipeline computes from it, completely or not at all.

    Raises `InputError` if no gateway can be configured for the rig, or the file cannot be written.
    """
    configuration = _configuration(rig, simulated, seed)
    header = RecordingHeader(
        software=__version__,
        site=configuration.gateway.site,
        crane=configuration.gateway.crane,
        sensor=configuration.gateway.sensor,
        boot_id=BOOT_ID,
        configuration_toml=to_toml(configuration),
    )
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
            recorder = Recorder(Path(folder), header, segment_s=ONE_SEGMENT_S, fsync_s=ONE_SEGMENT_S, quota_mb=QUOTA_MB)
            segment = recorder.start(START_NS)
            _record(recorder, configuration, _device(simulated, seed), simulated)
            recorder.close()
            compact(segment)
            segment.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from error


def _record(recorder: Recorder, configuration: Configuration, device: DeviceInfo, simulated: Simulated) -> None:
    recorder.set_device(device, START_NS)
    correction = correction_for(device, configuration.device.axes, None)
    pipeline = Pipeline(configuration, device, correction, HeaderMaker(), incidents=IncidentRegister(BOOT_ID))
    time_ns = START_NS + np.rint(simulated.time_s * 1e9).astype(np.int64)
    for first in range(0, len(time_ns), BLOCK_SAMPLES):
        part = slice(first, first + BLOCK_SAMPLES)
        temperature_c = round(float(simulated.temperature_c[part][-1]), 2)
        block = SampleBlock(time_ns[part], simulated.force_g[part], temperature_c)
        for emission in pipeline.process(block, CLOCK).messages:
            if TOPICS[emission.topic].logged:
                recorder.write(encode_message(emission.topic, emission.message, emission.log_time_ns))


def _configuration(rig: TwinRig, simulated: Simulated, seed: int) -> Configuration:
    table = {
        "device": {
            "kind": "simulated",
            "odr_hz": simulated.rate_hz,
            "range_g": simulated.full_scale_g,
            "seed": seed,
            "block_samples": BLOCK_SAMPLES,
        },
        "rope": {"length_m": rig.length_m},
        "housing": {"position_m": rig.position_m},
        "site": {"gravity_m_s2": rig.gravity_m_s2},
    }
    return validate(table, "the rig, as the recording's configuration")


def _device(simulated: Simulated, seed: int) -> DeviceInfo:
    """Return a device whose readings are in g and in the housing's axes, since the sensor's errors are effects of the model."""
    return DeviceInfo(
        kind="simulated",
        device_id=f"twin-{seed}",
        unit="g",
        odr_hz=simulated.rate_hz,
        units_per_g=1.0,
        full_scale_g=simulated.full_scale_g,
        noise_g=simulated.noise_g,
        calibrated_source=True,
        details={"simulated": "nothing here was measured"},
    )
