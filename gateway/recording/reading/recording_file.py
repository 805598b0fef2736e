"""Reading of recordings, incomplete ones as far as possible."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.well_known import MessageEncoding
from pydantic import ValidationError

from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway.recording.format.header import CONFIGURATION, DEVICE, device_from_metadata
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.topics import TOPICS, adapter

MAX_MESSAGE_BYTES = 1_000_000
"""Largest message of JSON that is read. Basis: a block of a second at 4 kHz has 100 kB."""
MAX_UNREADABLE = 10_000
"""After so many unreadable messages of a file no other is tried. Basis: a choice; such a file is not the gateway's, and each
costs as much as twenty readable ones."""
TOPIC_OF_PATH = {topic.path: topic.name for topic in TOPICS.values()}


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
