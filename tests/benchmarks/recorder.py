"""Recording: CPU per sample against other writers, bytes by topic, bytes written to the disk, and syncs."""

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import zstandard
from mcap.writer import Writer

from devices.block import DeviceInfo, SampleBlock
from devices.simulated.device import SimulatedCrane
from gateway import __version__
from gateway.calibration.correction import correction_for
from gateway.configuration.loading import validate
from gateway.pipeline.outgoing_message import EncodedMessage, HeaderMaker, encode_message
from gateway.pipeline.pipeline import Pipeline
from gateway.pki.signing_key import load_or_create_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader, encode_recorded, logged_topics, schema_bytes
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.compaction import compact
from gateway.recording.segments.recorder import Recorder
from gateway.topics import TOPICS
from tests.benchmarks.chain import CLOCK, cpu_s
from tests.clocks import SleeplessClock

RUNS = 5
CASES = ((1000, 32, 60), (125, 13, 600))
"""Samples per second, samples per block, seconds."""
MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Recorded:
    """What a pipeline has sent."""

    info: DeviceInfo
    messages: list[EncodedMessage]
    payloads: list[bytes]
    samples: int


def main() -> None:
    """Print the tables."""
    for rate_hz, block, seconds in CASES:
        data = _data(rate_hz, block, seconds)
        print(f"recorder: {rate_hz} Hz, blocks of {block}, {seconds} s, {len(data.messages)} messages")
        _print_cost(data)
        _print_bytes(data)


def _data(rate_hz: int, block: int, seconds: int) -> Recorded:
    configuration = validate({"device": {"odr_hz": rate_hz}}, "benchmark")
    device = SimulatedCrane(odr_hz=rate_hz, block_samples=block, length_m=12.0, position_m=9.0, clock=SleeplessClock())
    info = device.open()
    blocks: list[SampleBlock] = []
    while sum(map(len, blocks)) < rate_hz * seconds:
        if (read := device.read()) is not None:
            blocks.append(read)
    pipeline = Pipeline(configuration, info, correction_for(info, configuration.device.axes, None), HeaderMaker())
    emitted = [message for block in blocks for message in pipeline.process(block, CLOCK).messages]
    encoded = [encode_message(each.topic, each.message, each.log_time_ns) for each in emitted]
    return Recorded(info, encoded, [encode_recorded(each.message) for each in encoded], sum(map(len, blocks)))


def _print_cost(data: Recorded) -> None:
    """Writers of finished payloads, in turn in one run; then the recorder with everything that it does besides."""
    writers: dict[str, Callable[[Recorded, Path], None]] = {
        "this writer, a chunk each second": _write_ours,
        "mcap.writer, chunks of 1 MiB": _write_mcap,
    }
    try:
        import foxglove  # noqa: F401, PLC0415
    except ImportError:
        print("  foxglove-sdk is not installed here: `pip install foxglove-sdk` to compare with it")
    else:
        writers["foxglove-sdk, chunks of 1 MiB"] = _write_foxglove
    writers["recorder: encoding, summary, hashes, signatures, syncs"] = _record
    used: dict[str, list[float]] = {name: [] for name in writers}
    for _ in range(RUNS):
        for name, write in writers.items():
            with tempfile.TemporaryDirectory() as folder:
                begin_s = cpu_s()
                write(data, Path(folder))
                used[name].append((cpu_s() - begin_s) / data.samples * 1e6)
    reference = median(used["mcap.writer, chunks of 1 MiB"])
    for name, times in used.items():
        print(f"  {name:55} {median(times):7.3f} us of CPU per sample, {median(times) / reference:5.2f} of mcap.writer")


def _write_ours(data: Recorded, folder: Path) -> None:
    with (folder / "ours.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start("plumbline", "benchmark")
        channels = _channels(writer)
        flushed_ns = 0
        for message, payload in zip(data.messages, data.payloads, strict=True):
            writer.add_message(
                channels[message.topic], message.sequence, message.log_time_ns, message.publish_time_ns, payload
            )
            if message.log_time_ns - flushed_ns >= 1_000_000_000:
                writer.flush()
                flushed_ns = message.log_time_ns
        writer.finish()


def _write_mcap(data: Recorded, folder: Path) -> None:
    with (folder / "mcap.mcap").open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start("plumbline", "benchmark")
        channels = _channels(writer)
        for message, payload in zip(data.messages, data.payloads, strict=True):
            writer.add_message(
                channel_id=channels[message.topic],
                sequence=message.sequence,
                log_time=message.log_time_ns,
                publish_time=message.publish_time_ns,
                data=payload,
            )
        writer.finish()


def _channels(writer: Any) -> dict[str, int]:
    return {
        topic: writer.register_channel(
            topic=f"/{topic}",
            message_encoding="json",
            schema_id=writer.register_schema(
                name=TOPICS[topic].schema_name, encoding="jsonschema", data=schema_bytes(topic)
            ),
        )
        for topic in logged_topics()
    }


def _write_foxglove(data: Recorded, folder: Path) -> None:
    import foxglove  # noqa: PLC0415
    from foxglove.mcap import MCAPWriteOptions  # noqa: PLC0415

    context = foxglove.Context()
    options = MCAPWriteOptions(chunk_size=MEBIBYTE, compression_threads=0)
    with foxglove.open_mcap(folder / "foxglove.mcap", context=context, writer_options=options):
        channels = {
            topic: foxglove.Channel(
                f"/{topic}",
                message_encoding="json",
                schema=foxglove.Schema(name=TOPICS[topic].schema_name, encoding="jsonschema", data=schema_bytes(topic)),
                context=context,
            )
            for topic in logged_topics()
        }
        for message, payload in zip(data.messages, data.payloads, strict=True):
            channels[message.topic].log(payload, log_time=message.log_time_ns)


def _recorder(data: Recorded, folder: Path) -> tuple[Recorder, SegmentChain]:
    chain = SegmentChain(folder, "benchmark", load_or_create_key(folder / "key.pem"))
    header = RecordingHeader(__version__, "s", "c", "h", "b", "")
    recorder = Recorder(folder, header, segment_s=86400, fsync_s=1.0, quota_mb=16000, chain=chain)
    recorder.start(data.messages[0].log_time_ns)
    recorder.set_device(data.info, data.messages[0].log_time_ns)
    return recorder, chain


def _record(data: Recorded, folder: Path) -> None:
    recorder, _ = _recorder(data, folder)
    for message in data.messages:
        recorder.write(message)
        recorder.tick(message.log_time_ns)
    recorder.close()


class SyncCount:
    """Counts the syncs of this process while it is open."""

    def __init__(self) -> None:
        self.count, self._real = 0, os.fsync
        self._patch = patch.object(os, "fsync", self._fsync)

    def __enter__(self) -> "SyncCount":
        self._patch.start()
        return self

    def _fsync(self, descriptor: int) -> None:
        self.count += 1
        self._real(descriptor)

    def __exit__(self, *_error: object) -> None:
        self._patch.stop()


def _print_bytes(data: Recorded) -> None:
    with tempfile.TemporaryDirectory() as scratch, SyncCount() as syncs:
        folder = Path(scratch)
        recorder, chain = _recorder(data, folder)
        written = _written_bytes()
        for message in data.messages:
            recorder.write(message)
            recorder.tick(message.log_time_ns)
        recorder.close()
        live_syncs = syncs.count
        (path,) = recorder.take_uncompacted()
        live, live_written = path.stat().st_size, _written_bytes() - written
        begin_s = cpu_s()
        compact(path, chain)
        used_s = cpu_s() - begin_s
        size, all_written = path.stat().st_size, _written_bytes() - written
        hours = (data.messages[-1].log_time_ns - data.messages[0].log_time_ns) / 3.6e12
        n = data.samples
        print(f"  file: {live / n:.2f} bytes per sample while written, {size / n:.2f} compacted")
        print(f"  compaction: {used_s / n * 1e6:.2f} us of CPU per sample, in a thread of its own")
        print(
            f"  written to the disk: {live_written / n:.1f} bytes per sample, {all_written / n:.1f} with the compaction,"
        )
        print(
            f"    {all_written / size:.2f} per byte of the file that stays, in pages of 4 KiB as the kernel counts them"
        )
        print(f"  syncs: {live_syncs / hours:.0f} an hour, and {syncs.count - live_syncs} for each compaction")
        _print_topics(path, n)


def _written_bytes() -> int:
    """Bytes that this process has caused to be written to a disk."""
    fields = dict(line.split(": ") for line in Path("/proc/self/io").read_text().splitlines())
    return int(fields["write_bytes"])


def _print_topics(path: Path, n_samples: int) -> None:
    """Bytes of each topic compressed on its own, in chunks as long as those of the file."""
    compressor = zstandard.ZstdCompressor(compression_params=DENSE)
    content: dict[str, bytearray] = {}
    count: Counter[str] = Counter()
    for message in open_recording(path).messages():
        content.setdefault(message.topic, bytearray()).extend(message.data + message.log_time_ns.to_bytes(8, "little"))
        count[message.topic] += 1
    for topic, data in content.items():
        parts: Sequence[bytes] = [bytes(data[i : i + MEBIBYTE]) for i in range(0, len(data), MEBIBYTE)]
        compressed = sum(len(compressor.compress(part)) for part in parts)
        index = 16 * count[topic]
        print(f"    {topic:14} {compressed / n_samples:6.2f} + index {index / n_samples:5.2f} bytes per sample")


if __name__ == "__main__":
    main()
