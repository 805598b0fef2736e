"""Coverage-guided fuzzing of the parsers of files and requests, by atheris (the dependency group `fuzz`).

    python -m tests.fuzz.file_parsers mcap -max_total_time=600

Each target parses the bytes of the fuzzer as a user or a peer would have them parsed, and checks that nothing but the errors
that a person reads comes of it.
"""

import os
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import zstandard
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.writer import MCAP0_MAGIC

from devices.errors import DeviceError
from devices.tables.layout import read_head
from devices.tables.native import read_table
from gateway.authorization.caller import NotAuthorised
from gateway.authorization.credential import parse_credential
from gateway.calibration.input_files import read_record
from gateway.calibration.store import CalibrationStore
from gateway.configuration.loading import load
from gateway.errors import PlumblineError
from gateway.measurement.rig_file import read_rig
from gateway.outbox import AlertOutbox
from gateway.recalibration.journal import Journal
from gateway.recalibration.requests import parse_payload
from gateway.recording.chain.chain_state import read_state
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.export.recording_info import summarise_timeline
from gateway.recording.format.frames import RECORD_HEAD
from gateway.recording.reading.recording_file import open_recording, read_index
from gateway.recording.reading.timeline import open_timelines
from gateway.recording.segments.events import read_event_intervals
from gateway.verbs import VERBS

FOLDER = Path(tempfile.mkdtemp(prefix="plumbline-fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
KINDS = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)


def _file(content: bytes, name: str = "input") -> Path:
    path = FOLDER / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def parse_mcap(content: bytes) -> None:
    """Read a file of records with any content, the chunks of which are compressed here."""
    out = [MCAP0_MAGIC] if content[:1] != b"\x00" else []
    at = 1
    while at + 3 <= len(content):
        kind, size = content[at], int.from_bytes(content[at + 1 : at + 3], "little") % 512
        body = content[at + 3 : at + 3 + size]
        at += 3 + size
        opcode = KINDS[kind % len(KINDS)] if kind < 224 else kind
        if opcode == Opcode.CHUNK and kind < 112:
            packed = zstandard.compress(body)
            head = struct.pack("<QQQI", 0, kind, len(body) + (kind > 100), zlib.crc32(body) if kind > 50 else 0)
            body = head + struct.pack("<I4sQ", 4, b"zstd", len(packed)) + packed
        out.append(RECORD_HEAD.pack(opcode, len(body) + (kind == 223)) + body)
    path = _file(b"".join(out))
    with suppress(DeviceError):
        recording = open_recording(path)
        for message in recording.messages():
            assert isinstance(message.data, bytes), Message
            recording.decode(message)
    with suppress(DeviceError):
        read_index(path)


def parse_recording(content: bytes) -> None:
    """Read a file with these bytes, whole or damaged; seeds are recordings and the files of `test_hostile_recordings`."""
    path = _file(content, "input.mcap")
    with suppress(PlumblineError, DeviceError):
        verify_file(path, None)
    with suppress(PlumblineError, DeviceError):
        for timeline in open_timelines([path]):
            summarise_timeline(timeline)


def parse_table(content: bytes) -> None:
    """Read a table."""
    path = _file(content)
    read_head(path)
    with suppress(DeviceError):
        recording = read_table(path)
        assert len(recording) >= 2


def parse_configuration(content: bytes) -> None:
    """Read a configuration."""
    with suppress(PlumblineError):
        load(_file(content), {})


def parse_rig(content: bytes) -> None:
    """Read a rig."""
    with suppress(PlumblineError):
        read_rig(_file(content))


def parse_record(content: bytes) -> None:
    """Read a calibration record."""
    with suppress(PlumblineError):
        read_record(_file(content))


def parse_state(content: bytes) -> None:
    """Read every state file of a data folder."""
    Journal(_file(content, "session.json"))
    _file(content, "chain.json")
    with suppress(PlumblineError):
        read_state(FOLDER)
    store = CalibrationStore(FOLDER, "part-7")
    _file(content, "calibration/part-7/in_force.json")
    with suppress(PlumblineError):
        store.state()
    path = _file(content, "segment.mcap.event")
    with suppress(OSError):
        read_event_intervals(path.with_suffix(""))


def parse_outbox(content: bytes) -> None:
    """Open an outbox with a file in which every other line has a right checksum."""
    lines = content.split(b"\n")
    signed = [b"%08x %s" % (zlib.crc32(line), line) if k % 2 else line for k, line in enumerate(lines)]
    folder = FOLDER / "alerts"
    _file(b"\n".join(signed), "alerts/changes-00000000.log")
    outbox = AlertOutbox(folder)
    assert outbox.open() >= 0
    outbox.close()


def parse_request(content: bytes) -> None:
    """Parse the payload and the credential of a request of any verb."""
    verbs = [verb for verb in VERBS.values() if verb.request is not None]
    verb = verbs[content[0] % len(verbs)] if content else verbs[0]
    assert verb.request is not None
    with suppress(PlumblineError):
        parse_payload(verb.request, content[1:])
    with suppress(NotAuthorised):
        parse_credential(content[1:])


TARGETS: dict[str, Callable[[bytes], None]] = {
    "mcap": parse_mcap,
    "recording": parse_recording,
    "table": parse_table,
    "configuration": parse_configuration,
    "rig": parse_rig,
    "record": parse_record,
    "state": parse_state,
    "outbox": parse_outbox,
    "request": parse_request,
}


def main() -> None:
    """Fuzz the target that the first argument names; the others are libFuzzer's."""
    import atheris  # noqa: PLC0415  (a group of its own)

    target = TARGETS[sys.argv.pop(1)]
    os.environ.pop("PLUMBLINE_GATEWAY__DATA_DIR", None)
    atheris.instrument_all()
    atheris.Setup(sys.argv, target)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
