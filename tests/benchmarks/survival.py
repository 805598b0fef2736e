"""What is left of a recording after kills, power failures, truncations and bit flips: a campaign with a fixed seed.

Every round checks three things: nothing was lost but what the fault must cost, what is read is what was written, and the next
start of the recorder repairs the file and loses nothing that was readable.
"""

import argparse
import json
import os
import random
import signal
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from devices.errors import RecordingError
from gateway.packing import pack
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recording.format.content import RecordingHeader, encode_recorded
from gateway.recording.format.frames import RECORD_HEAD
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.compaction import CompactionError, compact
from gateway.recording.segments.recorder import Recorder
from tests.benchmarks.faulty_disk import FaultyDisk

START_NS = 1_767_225_600_000_000_000
FSYNC_S, BLOCK_S, BLOCK = 0.02, 0.002, 2
HEADER = RecordingHeader(
    software="campaign", site="s", crane="c", sensor="h", boot_id="b", configuration_toml="[gateway]\n"
)
DEVICE = DeviceInfo(kind="adxl355", device_id="d-1", unit="counts", odr_hz=1000.0, units_per_g=256_000.0)
Content = list[tuple[int, bytes]]
"""Sequence number and payload of each sample block of a file."""


@dataclass
class Findings:
    """Counts of rounds, and a line for each defect."""

    rounds: Counter[str] = field(default_factory=Counter)
    defects: list[str] = field(default_factory=list)
    largest_loss_s: float = 0.0

    def check(self, holds: bool, text: str) -> None:
        """Note a defect unless something holds."""
        if not holds:
            self.defects.append(text)


def sample_message(number: int) -> EncodedMessage:
    """Block number so and so, with noise of its own."""
    time_ns = START_NS + number * round(BLOCK_S * 1e9) + np.arange(BLOCK) * 1_000_000
    raw = np.random.default_rng(number).normal(0, 143, (BLOCK, 3)).astype(np.int32)
    now_ns = int(time_ns[-1])
    samples = pack(
        SampleBlock(time_ns, raw, 25.0), time_ns=now_ns, clock="synchronised", sequence=number, calibration_id=None
    )
    return encode_message("samples", samples, now_ns)


def make_recorder(folder: Path) -> Recorder:
    """A recorder that syncs often, so that many rounds fit into a minute."""
    return Recorder(folder, HEADER, segment_s=600, fsync_s=FSYNC_S, quota_mb=100)


def record(folder: Path, blocks: int, written: int | None = None, real_time: bool = False) -> Path:
    """Record blocks; each one's number goes to the descriptor `written` when the recorder has it."""
    recorder = make_recorder(folder)
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    began_s = time.monotonic()
    for number in range(blocks):
        message = sample_message(number)
        recorder.write(message)
        recorder.tick(message.log_time_ns)
        if written is not None:
            os.write(written, number.to_bytes(4, "little"))
        if real_time:
            time.sleep(max(0.0, began_s + number * BLOCK_S - time.monotonic()))
    recorder.close()
    return path


def content(path: Path) -> Content:
    """The readable sample blocks of a file; none where it is no recording."""
    try:
        return [(m.sequence, m.data) for m in open_recording(path).messages() if m.topic == "/samples"]
    except RecordingError:
        return []


def kill(findings: Findings, chance: random.Random) -> None:
    """One recorder killed at a random time; the next one repairs what it finds."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.close(reading)
                record(folder, 10_000, writing, real_time=True)
            finally:
                os._exit(0)
        os.close(writing)
        time.sleep(chance.uniform(0.005, 0.25))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(reading, "rb") as pipe:
            passed = len(pipe.read()) // 4
        check_restart(findings, folder, passed, "kill")


def crash(findings: Findings, point: int, power: bool) -> bool:
    """A recorder that ends at one point of its calls to the disk; return whether there was such a point."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.close(reading)
                with FaultyDisk(folder, crash_at=point, power=power):
                    record(folder, 60, writing)
                    for path in folder.glob("*.mcap"):
                        compact(path)
            finally:
                os._exit(0)
        os.close(writing)
        _, status = os.waitpid(child, 0)
        with os.fdopen(reading, "rb") as pipe:
            passed = len(pipe.read()) // 4
        check_restart(findings, folder, passed, "power failure" if power else "crash")
        return os.waitstatus_to_exitcode(status) != 0


def check_restart(findings: Findings, folder: Path, passed: int, kind: str) -> None:
    """What is readable at once, and after the next start."""
    findings.rounds[kind] += 1
    files = sorted(folder.glob("*.mcap"))
    before = [content(path) for path in files]
    kept = [block for blocks in before for block in blocks]
    expected = [(number, sample_payload(number)) for number in range(len(kept))]
    findings.check(kept == expected, f"{kind}: {len(kept)} blocks are not the first ones")
    loss_s = (passed - len(kept)) * BLOCK_S
    findings.largest_loss_s = max(findings.largest_loss_s, loss_s)
    findings.check(loss_s <= FSYNC_S + BLOCK_S + 1e-9, f"{kind}: {loss_s:.3f} s lost")
    recorder = make_recorder(folder)
    recorder.start(START_NS + 3600 * 10**9)
    for path in recorder.take_uncompacted():
        try:
            compact(path)
        except CompactionError:
            findings.check(not content(path), f"{kind}: {path.name} was not repaired")
    recorder.close()
    findings.check([content(path) for path in files] == before, f"{kind}: the next start changed what is readable")
    findings.check(not list(folder.glob(".*.part")), f"{kind}: an unfinished file is left")


def sample_payload(number: int) -> bytes:
    """The recorded bytes of a block."""
    return PAYLOADS.setdefault(number, _payload(number))


PAYLOADS: dict[int, bytes] = {}


def _payload(number: int) -> bytes:
    return encode_recorded(sample_message(number).message)


@dataclass(frozen=True)
class Specimen:
    """A file, its blocks, and the bytes of each chunk."""

    path: Path
    whole: bytes
    blocks: Content
    chunks: list[tuple[int, int, list[int]]]
    """First byte, byte after the last one, and numbers of the blocks."""


def specimen(folder: Path, compacted: bool, blocks: int = 100) -> Specimen:
    """A closed file, with short chunks or as compaction leaves it."""
    path = record(folder, blocks)
    if compacted:
        compact(path)
    whole = path.read_bytes()
    chunks: list[tuple[int, int, list[int]]] = []
    place = 8
    scratch = folder / "chunk.bin"
    while place < len(whole) - 8:
        opcode, length = RECORD_HEAD.unpack_from(whole, place)
        end = place + RECORD_HEAD.size + length
        if opcode == 6:
            scratch.write_bytes(whole[:8] + whole[place:end] + whole[end:] if place == 8 else whole[:end])
            numbers = [number for number, _ in content(scratch)]
            before = sum(len(chunk[2]) for chunk in chunks)
            chunks.append((place, end, numbers[before:]))
        place = end
    scratch.unlink()
    return Specimen(path, whole, content(path), chunks)


def truncate(findings: Findings, of: Specimen, size: int, scratch: Path) -> None:
    """A file cut at a byte keeps every chunk before the cut."""
    findings.rounds["truncation"] += 1
    scratch.write_bytes(of.whole[:size])
    due = sum(len(numbers) for _, end, numbers in of.chunks if end <= size)
    found = content(scratch)
    findings.check(found == of.blocks[: len(found)], f"cut at {size}: other content")
    findings.check(len(found) >= due, f"cut at {size}: {len(found)} blocks, {due} were complete")


def flip(findings: Findings, of: Specimen, place: int, bit: int, scratch: Path) -> None:
    """A flipped bit costs at most the chunk in which it is; nothing wrong is read."""
    findings.rounds["bit flip"] += 1
    changed = bytearray(of.whole)
    changed[place] ^= 1 << bit
    scratch.write_bytes(changed)
    damaged = {number for begin, end, numbers in of.chunks if begin <= place < end for number in numbers}
    found = content(scratch)
    if place >= 8:  # in the magic bytes: no MCAP file any more, which is said
        missing = {number for number, _ in of.blocks} - {number for number, _ in found} - damaged
        findings.check(not missing, f"bit {bit} of byte {place}: {len(missing)} blocks of other chunks are missing")
    findings.check(set(found) <= set(of.blocks), f"bit {bit} of byte {place}: changed content is read as true")


def campaign(kills: int, truncations: int, flips: int, seed: int) -> Findings:
    """All rounds; crashes and power failures at every point of the calls to the disk when there are kills at all."""
    findings, chance = Findings(), random.Random(seed)
    for _ in range(kills):
        kill(findings, chance)
    for power in (False, True):
        point = 1
        while kills and crash(findings, point, power):
            point += 1
    for compacted in (False, True):
        with tempfile.TemporaryDirectory() as folder:
            of = specimen(Path(folder), compacted)
            scratch = Path(folder) / "damaged.mcap"
            for _ in range(truncations // 2):
                truncate(findings, of, chance.randrange(len(of.whole)), scratch)
            for _ in range(flips // 2):
                flip(findings, of, chance.randrange(len(of.whole)), chance.randrange(8), scratch)
    return findings


def main() -> None:
    """Run the campaign and print its findings as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--truncations", type=int, default=10_000)
    parser.add_argument("--flips", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    found = campaign(arguments.kills, arguments.truncations, arguments.flips, arguments.seed)
    counts = {"rounds": found.rounds, "largest_loss_s": round(found.largest_loss_s, 4), "fsync_s": FSYNC_S}
    print(json.dumps({**counts, "defects": len(found.defects), "first_defects": found.defects[:20]}, indent=1))


if __name__ == "__main__":
    main()
