"""Copying of recordings record by record, whatever is readable of them."""

from collections.abc import Iterable

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema

from gateway.recording.deletions import DELETIONS
from gateway.recording.mcap_salvage import SalvageReport
from gateway.recording.mcap_writer import McapWriter
from gateway.recording.statements import SIGNATURE

LARGEST_NS = 2**63 - 1
STATED = frozenset({SIGNATURE, DELETIONS})
"""Metadata that are not copied: the gateway's statements are about the source's bytes."""


class RecordCopier:
    """Writes the records of one recording into another, in their order; schemas and channels get new ids."""

    def __init__(self, writer: McapWriter, losses: SalvageReport) -> None:
        self._writer = writer
        self._losses = losses
        self.metadata: dict[str, dict[str, str]] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._schema_ids: dict[int, int] = {0: 0}
        self._channel_ids: dict[int, int] = {}
        self._started = False
        self.messages = 0
        self.from_ns, self.to_ns = LARGEST_NS, 0
        """Gateway times of the first and the last message."""

    def copy(self, records: Iterable[McapRecord]) -> None:
        """Copy records; messages without a channel are counted as unreadable."""
        for record in records:
            self._add(record)

    def _add(self, record: McapRecord) -> None:
        match record:
            case Schema():
                self._schemas.setdefault(record.id, record)
                return
            case Channel():
                self._channels.setdefault(record.id, record)
                self._channel_id(record)
                return
            case _:
                self._start(record)
        match record:
            case Message():
                self._add_message(record)
            case Metadata() if record.name not in STATED:
                self.metadata[record.name] = record.metadata
                self._writer.add_metadata(record.name, record.metadata)
            case Attachment():
                self._writer.add_attachment(
                    create_time=record.create_time,
                    log_time=record.log_time,
                    name=record.name,
                    media_type=record.media_type,
                    data=record.data,
                )
            case _:
                pass

    def _start(self, record: McapRecord) -> None:
        if not self._started:
            known = record if isinstance(record, Header) else Header("", "")
            self._writer.start(known.profile, known.library)
            self._started = True

    def _add_message(self, message: Message) -> None:
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self._losses.unreadable_messages += 1
            return
        self._writer.add_message(
            self._channel_id(channel), message.sequence, message.log_time, message.publish_time, message.data
        )
        self.messages += 1
        self.from_ns = min(self.from_ns, message.log_time)
        self.to_ns = max(self.to_ns, message.log_time)

    def _channel_id(self, channel: Channel) -> int:
        if channel.id not in self._channel_ids:
            schema_id = self._schema_id(channel.schema_id)
            self._channel_ids[channel.id] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        return self._channel_ids[channel.id]

    def _schema_id(self, schema_id: int) -> int:
        if schema_id not in self._schema_ids:
            schema = self._schemas.get(schema_id)
            if schema is None:  # it was in a damaged chunk; the messages are kept without it
                return 0
            self._schema_ids[schema_id] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
        return self._schema_ids[schema_id]
