"""Copying of recordings record by record, whatever is readable of them, with a filter; recovery of a complete file by it."""

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from devices.errors import RecordingError
from gateway.atomic_io import replace_file
from gateway.recording.chain.statements import DELETIONS, SIGNATURE
from gateway.recording.format.content import ORIGIN, RECOVERED, SEGMENT
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, is_damaged, open_mcap, read_records
from gateway.recording.format.segment_summary import SUMMARY
from gateway.recording.reading.recording_file import RecordedMessage, RecordingFile

MAX_TIME_NS = 2**63 - 1
"""Definition: the largest signed time of 64 bits, in nanoseconds."""
STATEMENTS = frozenset({SIGNATURE, DELETIONS})
"""Metadata that are not copied: the gateway's statements are about the source's bytes."""

KeepMessage = Callable[[str, int], bool]
"""Takes the topic of a message, with its slash, and its gateway time; returns whether it is copied."""


class RecordCopier:
    """Writes records of recordings into another one, in their order; equal schemas and channels are written once."""

    def __init__(
        self, writer: McapWriter, losses: SalvageReport | None = None, keep: KeepMessage | None = None
    ) -> None:
        """`losses` counts the messages that cannot be copied; `keep` selects messages, without it all are copied."""
        self._writer = writer
        self._losses = SalvageReport() if losses is None else losses
        self._keep = keep
        self.metadata: dict[str, dict[str, str]] = {}
        self._attachments: dict[str, Attachment] = {}
        self._schema_ids: dict[tuple[str, str, bytes], int] = {}
        self._channel_ids: dict[tuple[object, ...], int] = {}
        self.messages = 0
        self.from_ns, self.to_ns = MAX_TIME_NS, 0
        """Gateway times of the first and the last message."""

    def copy(self, records: Iterable[McapRecord], *, with_summary: bool = False) -> None:
        """Copy the records of a file, the summary of all its messages only on request.

        Messages without a channel are counted as unreadable.
        """
        schemas: dict[int, Schema] = {}
        channels: dict[int, tuple[Channel, int]] = {}
        started = False
        for record in records:
            match record:
                case Schema():
                    schemas.setdefault(record.id, record)
                    continue
                case Channel():
                    if record.id not in channels:
                        channels[record.id] = record, self._channel_id(record, schemas.get(record.schema_id))
                    continue
            if not started:
                known = record if isinstance(record, Header) else Header("", "")
                self._writer.start(known.profile, known.library)
                started = True
            match record:
                case Message():
                    self._copy_message(record, channels.get(record.channel_id))
                case Metadata() if record.name not in STATEMENTS:
                    self.add_metadata(record.name, record.metadata)
                case Attachment() if with_summary or record.name != SUMMARY:
                    self.add_attachment(record)
                case _:
                    pass

    def add_message(self, message: RecordedMessage, schema: Schema | None) -> None:
        """Copy a message of any file with its schema."""
        channel_id = self._channel_id(message.channel, schema)
        self._add(channel_id, message.sequence, message.log_time_ns, message.publish_time_ns, message.data)

    def describe(self, file: RecordingFile) -> None:
        """Copy what a file has stated so far and is not copied yet: to be called before each message that it describes.

        Signature, number and summary of a segment are of the whole of it, and stay out.
        """
        for name, content in file.metadata.items():
            stated = {key: value for key, value in content.items() if key != SEGMENT}
            if name not in STATEMENTS and self.metadata.get(name) != stated:
                self.add_metadata(name, stated)
        self.attach(file)

    def attach(self, file: RecordingFile) -> None:
        """Copy the attachments that a file has had so far and that are not copied yet, but the summary of its messages."""
        for name, attachment in file.attachments.items():
            known = self._attachments.get(name)
            if name != SUMMARY and attachment is not known and (known is None or attachment.data != known.data):
                self.add_attachment(attachment)

    def add_metadata(self, name: str, content: dict[str, str]) -> None:
        """Copy a metadata record behind all messages so far."""
        self._writer.flush()
        self.metadata[name] = content
        self._writer.add_metadata(name, content)

    def add_attachment(self, attachment: Attachment) -> None:
        """Copy an attachment behind all messages so far."""
        self._writer.flush()
        self._attachments[attachment.name] = attachment
        self._writer.add_attachment(
            create_time=attachment.create_time,
            log_time=attachment.log_time,
            name=attachment.name,
            media_type=attachment.media_type,
            data=attachment.data,
        )

    def _copy_message(self, record: Message, channel: tuple[Channel, int] | None) -> None:
        if channel is None:
            self._losses.unreadable_messages += 1
        elif self._keep is None or self._keep(channel[0].topic, record.log_time):
            self._add(channel[1], record.sequence, record.log_time, record.publish_time, record.data)

    def _add(self, channel_id: int, sequence: int, time_ns: int, publish_time_ns: int, data: bytes) -> None:
        self._writer.add_message(channel_id, sequence, time_ns, publish_time_ns, data)
        self.messages += 1
        self.from_ns = min(self.from_ns, time_ns)
        self.to_ns = max(self.to_ns, time_ns)

    def _channel_id(self, channel: Channel, schema: Schema | None) -> int:
        schema_id = 0 if schema is None else self._schema_id(schema)  # it may have been in a damaged chunk
        key = channel.topic, channel.message_encoding, schema_id, *sorted(channel.metadata.items())
        if key not in self._channel_ids:
            self._channel_ids[key] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        return self._channel_ids[key]

    def _schema_id(self, schema: Schema) -> int:
        key = schema.name, schema.encoding, schema.data
        if key not in self._schema_ids:
            self._schema_ids[key] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
        return self._schema_ids[key]


class NothingRecordedError(RecordingError):
    """A recording was begun and ended before its first message: nothing was lost, and nothing can be recovered."""


@dataclass(frozen=True, slots=True)
class RecoveryResult:
    """The number of messages that were recovered, and the losses."""

    messages: int
    losses: SalvageReport


def recovered_path(path: Path) -> Path:
    """Return the name of a recovered copy beside its source."""
    return path.with_name(f"{path.name.removesuffix('.mcap')}.recovered.mcap")


def recover(path: Path | str, out: Path | str) -> RecoveryResult:
    """Write everything readable of a recording into the new file `out`, indexed and closed properly.

    The source does not change, and `out` appears completely or not at all. Raises `RecordingError` where the source has no
    message, `out` exists already, or it cannot be written.
    """
    path, out = Path(path), Path(out)
    open_mcap(path).close()
    if out.exists():
        raise RecordingError(f"{out}: exists already; choose another name")
    losses = SalvageReport()
    try:
        with replace_file(out) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            messages = _copy(path, McapWriter(file, DENSE), losses)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {error.strerror or error}; choose another place") from error
    return RecoveryResult(messages, losses)


def _copy(path: Path, writer: McapWriter, losses: SalvageReport) -> int:
    copier = RecordCopier(writer, losses)
    with open_mcap(path) as source:
        copier.copy(read_records(source, losses))
    if not copier.messages:
        if ORIGIN in copier.metadata and not is_damaged(losses):
            raise NothingRecordedError(
                f"{path}: was begun, and the gateway ended before its first message; nothing is lost"
            )
        raise RecordingError(f"{path}: contains no readable message; there is nothing to recover")
    lost = {name: json.dumps(value) for name, value in asdict(losses).items()}
    writer.add_metadata(RECOVERED, {"from": path.name, **lost})
    writer.finish()
    return copier.messages
