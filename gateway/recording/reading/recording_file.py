"""Reading of recordings, incomplete ones as far as possible.

The index of a segment, its times, its metadata and its summary without its messages, is read in milliseconds: from the heads of
the records of the data section, which is signed. The index at the end of a closed file is not: nothing is taken from it.
"""

import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.well_known import MessageEncoding
from mcap.writer import MCAP0_MAGIC
from pydantic import ValidationError

from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway.recording.format.content import (
    CONFIGURATION,
    CUT,
    DEVICE,
    ORIGIN,
    RECOVERED,
    REPAIRED,
    VOUCHER,
    device_from_metadata,
)
from gateway.recording.format.frames import (
    FOOTER_BYTES,
    INDEX_HEAD,
    MAX_RECORD_BYTES,
    RECORD_HEAD,
    TIME_AND_OFFSET_BYTES,
)
from gateway.recording.format.salvage import (
    CHUNK_TIMES,
    DAMAGED,
    FOOTER,
    PARSERS,
    SalvageReport,
    open_mcap,
    read_records,
    reading_mcap,
)
from gateway.recording.format.segment_summary import SUMMARY, SegmentSummary, decode_summary
from gateway.topics import TOPICS, adapter

MAX_MESSAGE_BYTES = 1_000_000
"""Largest message of JSON that is read. Basis: a block of a second at 4 kHz has 100 kB."""
MAX_UNREADABLE = 10_000
"""After so many unreadable messages of a file no other is tried. Basis: a choice; such a file is not the gateway's, and each
costs as much as twenty readable ones."""
GATEWAY_KEYS = ("site", "crane", "sensor")
TOPIC_OF_PATH = {topic.path: topic.name for topic in TOPICS.values()}
READ_OPCODES = frozenset({Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.ATTACHMENT})
DATA_END_LENGTH = 4
"""Definition: the content of a data end record is a checksum (MCAP)."""
READ_BYTES = 1 << 20
"""Bytes that are read at once. Basis: a choice; more does not read faster, and a small board has the memory."""


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """One message of a recording."""

    channel: Channel
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes

    @property
    def topic(self) -> str:
        """The channel's topic, with its slash."""
        return self.channel.topic


@dataclass(frozen=True, slots=True)
class Selection:
    """The messages from `begin_ns` until before `end_ns` of gateway time, of some topics; None: without limit, all topics."""

    begin_ns: int | None = None
    end_ns: int | None = None
    topics: frozenset[str] | None = None
    """With their slash."""

    def may_contain(self, first_ns: int, last_ns: int) -> bool:
        """Return whether messages between two times may be selected."""
        begins_in_time = self.end_ns is None or first_ns < self.end_ns
        return begins_in_time and (self.begin_ns is None or last_ns >= self.begin_ns)

    def contains(self, topic: str, time_ns: int) -> bool:
        """Return whether a message is selected."""
        return (self.topics is None or topic in self.topics) and self.may_contain(time_ns, time_ns)


EVERYTHING = Selection()


def open_recording(path: Path | str) -> "RecordingFile":
    """Open a recording, complete or not. Raises `RecordingError` where there is no MCAP file of that name."""
    path = Path(path)
    open_mcap(path).close()
    return RecordingFile(path)


@dataclass(slots=True)
class RecordingFile:
    """A recording. Its schemas, channels, metadata and attachments are known when the messages have been read."""

    path: Path
    header: Header | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    losses: SalvageReport = field(default_factory=SalvageReport)
    _device: tuple[dict[str, str], DeviceInfo] | None = None
    """The metadata of the device, and what they mean."""

    @property
    def origin(self) -> dict[str, str]:
        """What `SegmentIndex.origin` has, of the run of which the last message was: a report's recording may have several."""
        return self.metadata.get(ORIGIN, {})

    @property
    def boot_id(self) -> str:
        """Id of that run."""
        return self.origin.get("boot_id", "")

    @property
    def configuration_toml(self) -> str | None:
        """The configuration of the gateway, known when its first sample has been read; None: there is none."""
        attachment = self.attachments.get(CONFIGURATION)
        return None if attachment is None else attachment.data.decode(errors="replace")

    def messages(self, selection: Selection = EVERYTHING) -> Iterator[RecordedMessage]:
        """Yield every readable message of a selection in the order of writing. Raises `RecordingError`."""
        self.losses = SalvageReport()

        def is_wanted(first_ns: int, last_ns: int) -> bool:
            return not self.channels or selection.may_contain(first_ns, last_ns)  # the first chunk has the channels

        with open_mcap(self.path) as file:
            try:
                for record in read_records(file, self.losses, is_wanted):
                    if isinstance(record, Message):
                        yield from self._message(record, selection)
                    else:
                        self._store(record)
            except OSError as error:
                raise RecordingError(
                    f"{self.path}: byte {file.tell()}: {error.strerror}; copy it off this disk with `ddrescue` and try again"
                ) from error

    def decode(self, message: RecordedMessage) -> Any:
        """Decode a message of the gateway's own topics; None for others, and for unreadable ones, which are counted."""
        name, losses = TOPIC_OF_PATH.get(message.topic), self.losses
        if name is None or message.channel.message_encoding != MessageEncoding.JSON:
            return None
        if losses.unreadable_messages < MAX_UNREADABLE:
            with suppress(ValidationError):
                return adapter(name).validate_json(message.data)
        losses.unreadable_messages += 1
        return None

    def device(self) -> DeviceInfo:
        """Return the device, known when its first sample has been read. Raises `RecordingError` where it is not described."""
        metadata = self.metadata.get(DEVICE)
        if metadata is None:
            raise RecordingError(
                f"{self.path}: has samples but no metadata 'device', which describes them; record it with the gateway"
            )
        if self._device is None or self._device[0] != metadata:
            try:
                self._device = metadata, device_from_metadata(metadata)
            except ValueError as error:
                raise RecordingError(f"{self.path}: {error}; it was written by another version") from error
        return self._device[1]

    def _message(self, record: Message, selection: Selection) -> Iterator[RecordedMessage]:
        channel = self.channels.get(record.channel_id)
        if channel is None or (
            len(record.data) > MAX_MESSAGE_BYTES and channel.message_encoding == MessageEncoding.JSON
        ):
            self.losses.unreadable_messages += 1
        elif selection.contains(channel.topic, record.log_time):
            yield RecordedMessage(channel, record.log_time, record.publish_time, record.sequence, record.data)

    def _store(self, record: object) -> None:
        match record:
            case Schema():
                self.schemas[record.id] = record
            case Channel():
                self.channels[record.id] = record
            case Metadata():
                self.metadata[record.name] = record.metadata
            case Attachment():
                self.attachments[record.name] = record
            case Header():
                self.header = record
            case _:
                pass


@dataclass(slots=True)
class SegmentIndex:
    """What is known of a file without its messages."""

    path: Path
    size_bytes: int
    is_closed: bool = False
    """The file has its end, and nothing may be added to it."""
    is_empty: bool = True
    """There is no message."""
    from_ns: int = 0
    """Gateway time of the first message."""
    to_ns: int = 0
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: list[str] = field(default_factory=list)
    summary: SegmentSummary | None = None
    """The summary that the recorder wrote; None: the segment must be read."""
    voucher: bytes = b""
    """What vouches for the key of the signatures, in JSON; empty: nothing does."""
    data_end: int = 0
    """Place of the record at the end of the data, which has their checksum; 0: not closed."""

    @property
    def is_torn(self) -> bool:
        """The end is missing: of a kill or power failure, also where it was repaired since, or of a time that was cut out."""
        is_recovered = self.metadata.get(RECOVERED, {}).get("closed") == "false"
        return not self.is_closed or is_recovered or bool({REPAIRED, CUT} & self.metadata.keys())

    @property
    def origin(self) -> dict[str, str]:
        """Software, site, crane, sensor and boot id of the gateway; empty where another program wrote the file."""
        return self.metadata.get(ORIGIN, {})

    @property
    def gateway(self) -> str:
        """Site, crane and sensor; the path where another program wrote the file."""
        return "/".join(self.origin.get(key, "?") for key in GATEWAY_KEYS) if self.origin else str(self.path)

    @property
    def boot_id(self) -> str:
        """Id of the run of the gateway."""
        return self.origin.get("boot_id", "")


def read_index(path: Path) -> SegmentIndex:
    """Return the index of a segment. Raises `RecordingError` where it cannot be read or is not an MCAP file."""
    with reading_mcap(path) as file:
        return _read_heads(file, SegmentIndex(path, os.fstat(file.fileno()).st_size))


def is_altered(index: SegmentIndex) -> bool:
    """Return whether the content of a closed file does not match its checksum. Raises `RecordingError`."""
    checksum, left = 0, index.data_end
    with reading_mcap(index.path) as file:
        file.seek(0)
        while left > 0 and (part := file.read(min(left, READ_BYTES))):
            checksum = zlib.crc32(part, checksum)
            left -= len(part)
        record = file.read(RECORD_HEAD.size + DATA_END_LENGTH)
    promised = int.from_bytes(record[RECORD_HEAD.size :], "little")
    return record[:1] != bytes([Opcode.DATA_END]) or promised not in (0, checksum)


def _read_heads(file: BinaryIO, index: SegmentIndex) -> SegmentIndex:
    count = 0
    file.seek(len(MCAP0_MAGIC))
    while len(head := file.read(RECORD_HEAD.size)) == RECORD_HEAD.size:
        opcode, length = RECORD_HEAD.unpack(head)
        end = file.tell() + length
        if opcode == 0 or end > index.size_bytes:  # 0 is not an opcode: some file systems leave zeros
            break
        if opcode == Opcode.DATA_END:
            index.data_end = end - length - RECORD_HEAD.size
            index.is_closed = _is_end(file, index.size_bytes)
            break
        if opcode in READ_OPCODES:
            with suppress(*DAMAGED):  # counted when the messages are read
                count += _add_record(index, file, opcode, length)
        file.seek(end)
    if not index.is_closed or (index.summary is not None and index.summary.message_count != count):
        index.summary = None  # the file goes on behind it, or it was copied from another file
    return index


def _is_end(file: BinaryIO, size: int) -> bool:
    """Return whether a file ends with a footer."""
    file.seek(max(0, size - FOOTER.size - len(MCAP0_MAGIC)))
    end = file.read()
    return end[: RECORD_HEAD.size] == RECORD_HEAD.pack(Opcode.FOOTER, FOOTER_BYTES) and end.endswith(MCAP0_MAGIC)


def _add_record(index: SegmentIndex, file: BinaryIO, opcode: int, length: int) -> int:
    """Add a record; return the number of messages that it tells of."""
    match opcode:
        case Opcode.CHUNK:
            first_ns, last_ns = CHUNK_TIMES.unpack(file.read(CHUNK_TIMES.size))
            index.from_ns = first_ns if index.is_empty else min(index.from_ns, first_ns)
            index.to_ns, index.is_empty = max(index.to_ns, last_ns), False
        case Opcode.MESSAGE_INDEX:
            _, entries_bytes = INDEX_HEAD.unpack(file.read(INDEX_HEAD.size))
            return int(entries_bytes) // TIME_AND_OFFSET_BYTES
        case Opcode.METADATA | Opcode.ATTACHMENT if length <= MAX_RECORD_BYTES:
            match PARSERS[opcode](file.read(length)):
                case Metadata(name=name, metadata=content):
                    index.metadata[name] = content
                case Attachment(name=name, data=data):
                    index.attachments.append(name)
                    if name == SUMMARY:
                        index.summary = decode_summary(data)
                    elif name == VOUCHER:
                        index.voucher = data
        case _:
            pass
    return 0
