"""CPU of the whole chain per sample: decoded block -> calibration .. alerts -> MCAP -> bus, at several block lengths."""

import resource
import socket
import tempfile
from pathlib import Path

import zenoh

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.device import SimulatedCrane
from gateway import __version__
from gateway.bus.session import open_session
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import to_toml, validate
from gateway.configuration.model import Configuration
from gateway.pipeline.outgoing_message import ClockState, EncodedMessage, HeaderMaker, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.recording.format.content import RecordingHeader
from gateway.recording.segments.recorder import Recorder
from gateway.topics import TOPICS
from tests.clocks import SleeplessClock
from tests.gateway.recording.recorded_files import summarise
from tests.values import present

RATE_HZ = 1000
SECONDS = 60
BLOCKS = (1, 8, 32, 128)
CLOCK = ClockState("synchronised", 0)
PARTS = ("pipeline", "encode", "mcap", "bus")
"""The pipeline; messages to JSON; recording; publishing."""


def cpu_s() -> float:
    """CPU of this process with all its threads."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def free_endpoint() -> str:
    """A loopback endpoint that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"tcp/127.0.0.1:{server.getsockname()[1]}"


def main() -> None:
    """Print a row per block length."""
    print(f"chain: us of CPU per sample, {SECONDS} s of the simulated crane at {RATE_HZ} Hz")
    columns = "".join(f"{name:>10}" for name in (*PARTS, "all", "% core", "B/sample"))
    print(f"{'block':>6}{columns}")
    for block in BLOCKS:
        row = measure(block)
        total = sum(row[name] for name in PARTS)
        parts = "".join(f"{row[name]:10.2f}" for name in PARTS)
        print(f"{block:6d}{parts}{total:10.2f}{total * RATE_HZ / 1e4:10.3f}{row['bytes']:10.2f}")


def measure(block: int) -> dict[str, float]:
    """Microseconds per sample of each part, and bytes per sample."""
    configuration = validate({"device": {"odr_hz": RATE_HZ}, "recorder": {"fsync_s": 1.0}}, "benchmark")
    clock = SleeplessClock()
    device = SimulatedCrane(odr_hz=RATE_HZ, block_samples=block, length_m=12.0, position_m=9.0, clock=clock)
    info = device.open()
    blocks: list[SampleBlock] = []
    samples = 0
    while samples < RATE_HZ * SECONDS:
        read = device.read()
        if read is not None:
            blocks.append(read)
            samples += len(read)
    correction = correction_for(info, configuration.device.axes, None)
    pipeline = Pipeline(configuration, info, correction, HeaderMaker())
    used: dict[str, float] = {}
    begin_s = cpu_s()
    emissions = [emission for b in blocks for emission in pipeline.process(b, CLOCK).messages]
    used["pipeline"] = cpu_s() - begin_s
    begin_s = cpu_s()
    encoded = [encode_message(e.topic, e.message, e.log_time_ns) for e in emissions]
    used["encode"] = cpu_s() - begin_s
    used["mcap"], size = _record(configuration, info, encoded)
    used["bus"] = _publish(configuration.gateway.key, encoded)
    return {name: seconds / samples * 1e6 for name, seconds in used.items()} | {"bytes": size / samples}


def _record(configuration: Configuration, info: DeviceInfo, encoded: list[EncodedMessage]) -> tuple[float, int]:
    """CPU of recording, and the bytes of the file."""
    with tempfile.TemporaryDirectory() as folder:
        header = RecordingHeader(
            software=__version__,
            site="s",
            crane="c",
            sensor="h",
            boot_id="b",
            configuration_toml=to_toml(configuration),
        )
        recorder = Recorder(Path(folder), header, segment_s=86400, fsync_s=1.0, quota_mb=16000)
        recorder.start(encoded[0].log_time_ns)
        recorder.set_device(info, encoded[0].log_time_ns)
        begin_s = cpu_s()
        for message in encoded:
            recorder.write(message)
            recorder.tick(message.log_time_ns)
        path = recorder.path
        recorder.close()
        used_s = cpu_s() - begin_s
        return used_s, summarise(present(path)).size_bytes


def _publish(key: str, encoded: list[EncodedMessage]) -> float:
    """CPU of putting, unpaced, with a subscriber in this process's own second session."""
    endpoint = free_endpoint()
    session = open_session("peer", [], [endpoint])
    publishers = {
        name: session.declare_publisher(f"{key}/{name}", congestion_control=zenoh.CongestionControl.DROP)
        for name, topic in TOPICS.items()
        if topic.published
    }
    begin_s = cpu_s()
    for message in encoded:
        if message.topic in publishers:
            publishers[message.topic].put(message.payload)
    used_s = cpu_s() - begin_s
    session.close()
    return used_s
