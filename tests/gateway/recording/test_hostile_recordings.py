"""Recordings that claim or contain far more than their size: refused within bounded memory and time."""

import json
import os
import resource
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from devices.errors import RecordingError
from gateway.recording.format.frames import MAX_CHUNK_BYTES, RECORD_HEAD, ChunkError, ChunkReader
from gateway.recording.format.mcap_writer import McapWriter, serialise
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.segments.copying import recover

ROOT = Path(__file__).parents[3]
MEMORY_BYTES = 1_500_000_000
MESSAGE = RECORD_HEAD.pack(Opcode.MESSAGE, 22) + struct.pack("<HIQQ", 1, 0, 0, 0)


def zstd(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=3).compress(data)


def chunk(data: bytes, compressed: bytes, compression: str, size: int | None = None, crc: int | None = None) -> bytes:
    size = len(data) if size is None else size
    crc = zlib.crc32(data) if crc is None else crc
    name = compression.encode()
    content = struct.pack("<QQQII", 0, 0, size, crc, len(name)) + name + struct.pack("<Q", len(compressed)) + compressed
    return RECORD_HEAD.pack(Opcode.CHUNK, len(content)) + content


def write(path: Path, *records: bytes) -> Path:
    path.write_bytes(MCAP0_MAGIC + RECORD_HEAD.pack(Opcode.HEADER, 8) + bytes(8) + b"".join(records))
    return path


@pytest.fixture(scope="module")
def zeros() -> bytes:
    """A hundred megabytes of zeros, compressed to a few kilobytes."""
    compressor = zstandard.ZstdCompressor(level=3).compressobj()
    part = bytes(1_000_000)
    return b"".join([*(compressor.compress(part) for _ in range(100)), compressor.flush()])


def bombs(zeros: bytes) -> dict[str, bytes]:
    much = bytes(50_000_000) if zeros else b""
    return {
        "100 MB of zeros": chunk(b"", zeros, "zstd", size=100_000_000, crc=0),
        "zeros that claim to be few": chunk(b"", zeros, "zstd", size=1000, crc=0),
        "10 GB claimed": chunk(b"", b"x", "zstd", size=10**10, crc=0),
        "zeros within the limit": chunk(much, zstd(much), "zstd"),
        "lz4 of zeros": chunk(b"", lz4.frame.compress(much), "lz4", size=1000, crc=0),
        "no compression known": chunk(b"x", b"x", "snappy"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", list(bombs(b"")))
def test_a_bomb_is_one_damaged_record(zeros: bytes, tmp_path: Path, name: str) -> None:
    path = write(tmp_path / "bomb.mcap", bombs(zeros)[name])
    losses = SalvageReport()
    with open_mcap(path) as file:
        assert len(list(read_records(file, losses))) == 1  # the header
    assert losses.damaged_records == 1


def test_all_records_together_are_bounded() -> None:
    data = MESSAGE * 60_000
    record = Chunk("zstd", zstd(data), 0, 0, zlib.crc32(data), len(data))
    reader = ChunkReader(file_bytes=10_000)
    assert len(list(reader.frames(record))) == 60_000
    with pytest.raises(ChunkError, match="more records than are read"):
        reader.frames(record)


def test_all_chunks_together_are_bounded() -> None:
    data = MESSAGE + RECORD_HEAD.pack(Opcode.ATTACHMENT, 3_000_000) + bytes(3_000_000)
    record = Chunk("zstd", zstd(data), 0, 0, zlib.crc32(data), len(data))
    reader = ChunkReader(file_bytes=10_000)
    for _ in range((MAX_CHUNK_BYTES + 2_000_000) // len(data)):
        assert next(iter(reader.frames(record)))
    with pytest.raises(ChunkError, match="larger than any that is read"):
        reader.frames(record)


@pytest.mark.slow
@pytest.mark.parametrize("command", [["record", "info"], ["measure"], ["record", "recover", "--out", "out.mcap"]])
def test_a_bomb_costs_a_command_little_memory_and_time(zeros: bytes, tmp_path: Path, command: list[str]) -> None:
    path = write(tmp_path / "bomb.mcap", *[bombs(zeros)["100 MB of zeros"]] * 20)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CPU, (30, 30))

    done = subprocess.run(
        [sys.executable, "-m", "gateway", *command, str(path)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode in (2, 3)
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, kind: str) -> None:
    path = {"pipe": tmp_path / "pipe", "device": Path("/dev/zero"), "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(path)
    with pytest.raises(RecordingError, match=r"is a (pipe|directory)"):
        open_mcap(path)


@pytest.mark.slow
def test_as_many_channels_as_the_format_has_are_recovered(tmp_path: Path) -> None:
    written = BytesIO()
    writer = McapWriter(written)
    writer.start("", "")
    for number in range(65_536):
        writer.register_channel(f"/{number}", "json", 0)
    writer.add_message(0, 0, 0, 0, b"{}")
    writer.finish()
    path = tmp_path / "many.mcap"
    path.write_bytes(written.getvalue())
    begun_s = time.process_time()
    assert recover(path, tmp_path / "out.mcap").messages == 1
    assert time.process_time() - begun_s < 60


MAX_RESIDENT_BYTES = 300_000_000
INPUT_BYTES = 2_000_000
MAX_RESIDENT_OF_REPEATED_BYTES = 170_000_000
"""Of a file of so many repeated records: 60 MB of the program itself, and 55 bytes for each of the file."""
MEASURE = """
import json, os, resource, sys
from gateway.cli.main import main
main(["measure", sys.argv[1]])
for line in sys.stdin:
    output, arguments = json.loads(line)
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (120, 120))
        os.dup2(os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        os.dup2(1, 2)
        sys.exit(main(arguments))
    _, status, usage = os.wait4(child, 0)
    print(os.waitstatus_to_exitcode(status), usage.ru_maxrss, flush=True)
"""
"""Runs each command in a fork of a process that has loaded the program, and states its exit code and memory, KiB.

The memory of a fork begins at that of its parent. A command without end is ended.
"""
EARLY_INDEX = RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, 6) + struct.pack("<HI", 1, 0)
DEFINITIONS = serialise(Schema(1, b"{}", "jsonschema", "plumbline.Samples"), Channel(1, "/samples", "json", {}, 1))
VERBS = [["record", "info"], ["record", "verify"], ["record", "incident", "--list"], ["record", "replay"], ["measure"]]


def samples(count: int, number: int = 0) -> bytes:
    """A message of samples, all of them zero."""
    readings = "[" + ",".join("0" * count) + "]"
    time_ns = 1_767_225_600_000_000_000 + number * 1_000_000_000
    content = (
        f'{{"time_ns":{time_ns},"clock":"synchronised","sequence":{number},"calibration_id":null,'
        f'"first_log_time_ns":{time_ns},"period_ns":2000000,"unit":"counts","packing":"difference",'
        f'"x":{readings},"y":{readings},"z":{readings},"lost":0,"invalid":0}}'
    )
    return serialise(Message(1, time_ns, content.encode(), time_ns, number))


def packed(data: bytes) -> bytes:
    return chunk(data, zstd(data), "zstd")


def repeated(record: bytes) -> bytes:
    return record * (INPUT_BYTES // len(record))


def cut_schema() -> bytes:
    """A summary section with the right checksum, whose schema ends too early."""
    data_end = serialise(DataEnd(0))
    start = len(MCAP0_MAGIC) + RECORD_HEAD.size + 8 + len(data_end)
    section = RECORD_HEAD.pack(Opcode.SCHEMA, 5) + b"\1\0\xff\0\0"
    checksum = zlib.crc32(serialise(Footer(start, 0, 0))[:-4], zlib.crc32(section))
    return data_end + section + serialise(Footer(start, 0, checksum)) + MCAP0_MAGIC


HOSTILE: dict[str, Callable[[], bytes]] = {
    "one message of 16 MB": lambda: packed(DEFINITIONS + samples(2_700_000)),
    "messages of nothing": lambda: packed(DEFINITIONS + serialise(Message(1, 0, b"", 0, 0)) * 1_900_000),
    "channels": lambda: packed(serialise(Channel(1, "/c", "json", {}, 0)) * 1_000_000),
    "a claim of 6 GB": lambda: RECORD_HEAD.pack(Opcode.ATTACHMENT, 6_000_000_000),
    "a cut schema": cut_schema,
    "an index before the first chunk": lambda: EARLY_INDEX + packed(DEFINITIONS + samples(10)),
    "2 MB of short messages": lambda: repeated(
        packed(DEFINITIONS + b"".join(samples(50, number) for number in range(3000)))
    ),
    "2 MB of long messages": lambda: repeated(
        packed(DEFINITIONS + b"".join(samples(160_000, number) for number in range(30)))
    ),
    "2 MB of metadata": lambda: repeated(serialise(Metadata("a", {}))),
    "2 MB of unknown records": lambda: repeated(RECORD_HEAD.pack(0x80, 0)),
}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator["subprocess.Popen[str]"]:
    """A process that runs commands, and says first what it thinks of a recording of nothing."""
    empty = write(tmp_path_factory.mktemp("empty") / "empty.mcap")
    with subprocess.Popen(
        [sys.executable, "-c", MEASURE, str(empty)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(HOSTILE))
def test_no_hostile_file_costs_more_memory_than_allowed(
    tmp_path: Path, program: "subprocess.Popen[str]", name: str
) -> None:
    path = write(tmp_path / "hostile.mcap", HOSTILE[name]())
    if name == "a claim of 6 GB":
        os.truncate(path, 6_000_000_100)  # without a block on the disk
    assert path.stat().st_blocks * 512 <= INPUT_BYTES + 8192
    costs = {
        " ".join(verb): cost_of(program, [*verb, str(path)], tmp_path / "output")
        for verb in VERBS
        if "GB" not in name or verb[1:] != ["verify"]
    }
    most_bytes = MAX_RESIDENT_OF_REPEATED_BYTES if name.startswith("2 MB") else MAX_RESIDENT_BYTES
    for verb, (resident_bytes, said) in costs.items():
        assert "Traceback" not in said, said
        assert resident_bytes <= most_bytes, (verb, costs)


def cost_of(program: "subprocess.Popen[str]", arguments: list[str], output: Path) -> tuple[int, str]:
    """The most resident memory of a command, and the end of what it says."""
    assert program.stdin is not None
    assert program.stdout is not None
    print(json.dumps([str(output), arguments]), file=program.stdin, flush=True)
    code, resident_kib = map(int, program.stdout.readline().split())
    said = output.read_text(errors="replace")[-2000:]
    assert code in (0, 1, 2, 3), (code, said)
    return resident_kib * 1024, said
