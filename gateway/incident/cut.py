"""The part of recordings that belongs to an incident, as an MCAP file of its own that any reader opens."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BufferedWriter
from typing import BinaryIO

from mcap.records import Attachment, Channel, Schema
from mcap.writer import Writer

from gateway import __version__
from gateway.recording.copying import STATED
from gateway.recording.header import PROFILE, SEGMENT
from gateway.recording.reader import RecordedMessage, RecordingFile
from gateway.recording.segment_summary import SUMMARY

CUT = "cut"
"""Name of the metadata record on what was cut out."""


@dataclass(slots=True)
class CutWriter:
    """Copies messages unchanged, with the schemas, channels, metadata and attachments of their files."""

    stream: BinaryIO | BufferedWriter
    _writer: Writer = field(init=False)
    _channels: dict[tuple[str, str, bytes], int] = field(default_factory=dict)
    _metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    _attachments: dict[str, Attachment] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._writer = Writer(self.stream)
        self._writer.start(profile=PROFILE, library=f"plumbline {__version__}")

    def add(self, file: RecordingFile, message: RecordedMessage) -> None:
        """Copy a message, whole."""
        schema = file.schemas.get(message.channel.schema_id)
        self._writer.add_message(
            channel_id=self._channel_id(message.channel, schema),
            log_time=message.log_time_ns,
            data=message.data,
            publish_time=message.publish_time_ns,
            sequence=message.sequence,
        )

    def add_parts(self, file: RecordingFile) -> None:
        """Copy metadata and attachments of a file that has been read; those of later files replace earlier ones.

        Signature, number and summary of a segment are of the whole of it, and stay out.
        """
        metadata = {name: content for name, content in file.metadata.items() if name not in STATED}
        self._metadata |= {
            name: {key: value for key, value in content.items() if key != SEGMENT} for name, content in metadata.items()
        }
        self._attachments |= {name: each for name, each in file.attachments.items() if name != SUMMARY}

    def finish(self, about: Mapping[str, str]) -> None:
        """Write metadata and attachments, and `about` as the metadata record CUT, and close the file."""
        for name, content in {**self._metadata, CUT: dict(about)}.items():
            self._writer.add_metadata(name, content)
        for attachment in self._attachments.values():
            self._writer.add_attachment(
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                name=attachment.name,
                media_type=attachment.media_type,
                data=attachment.data,
            )
        self._writer.finish()

    def _channel_id(self, channel: Channel, schema: Schema | None) -> int:
        key = channel.topic, channel.message_encoding, b"" if schema is None else schema.data
        if key not in self._channels:
            schema_id = 0
            if schema is not None:
                schema_id = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._channels[key] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        return self._channels[key]
