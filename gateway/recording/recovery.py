"""Recovery of a complete file from an incomplete one."""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from mcap.records import Channel
from mcap.writer import Writer

from devices.errors import RecordingError
from gateway.atomic_io import replace_file
from gateway.recording.header import RECOVERED
from gateway.recording.mcap_salvage import SalvageReport
from gateway.recording.reader import RecordingFile, open_recording
from gateway.recording.segment_summary import SUMMARY


@dataclass(frozen=True, slots=True)
class RecoveryResult:
    """The number of messages that were recovered, and the losses."""

    messages: int
    losses: SalvageReport


def recover(path: Path | str, out: Path | str) -> RecoveryResult:
    """Write everything readable of a recording into the new file `out`, indexed and closed properly.

    The source does not change, and `out` appears completely or not at all. Raises `RecordingError` where the source has no
    message, `out` exists already, or it cannot be written.
    """
    out = Path(out)
    source = open_recording(path)
    if out.exists():
        raise RecordingError(f"{out}: exists already; choose another name")
    try:
        with replace_file(out) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            messages = _copy(source, Writer(file, enable_data_crcs=True))
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {error.strerror or error}; choose another place") from error
    return RecoveryResult(messages, source.losses)


def _copy(source: RecordingFile, writer: Writer) -> int:
    """Copy the messages first: the metadata and attachments are known only when the messages have been read."""
    channels = _ChannelMap(source, writer)
    count = 0
    for message in source.messages():
        if not count:
            profile, library = (source.header.profile, source.header.library) if source.header else ("", "")
            writer.start(profile=profile, library=library)
        writer.add_message(
            channel_id=channels.new_id(message.channel),
            log_time=message.log_time_ns,
            data=message.data,
            publish_time=message.publish_time_ns,
            sequence=message.sequence,
        )
        count += 1
    if not count:
        raise RecordingError(f"{source.path}: contains no readable message; there is nothing to recover")
    for channel in source.channels.values():
        channels.new_id(channel)
    for attachment in source.attachments.values():
        if attachment.name != SUMMARY:  # it is of the whole source
            writer.add_attachment(**asdict(attachment))
    losses = {name: json.dumps(value) for name, value in asdict(source.losses).items()}
    for name, metadata in {**source.metadata, RECOVERED: {"from": source.path.name, **losses}}.items():
        writer.add_metadata(name, metadata)
    writer.finish()
    return count


class _ChannelMap:
    """The numbers of schemas and channels in the new file, assigned when they are first needed."""

    def __init__(self, source: RecordingFile, writer: Writer) -> None:
        self._source = source
        self._writer = writer
        self._schema_ids: dict[int, int] = {0: 0}
        self._channel_ids: dict[int, int] = {}

    def new_id(self, channel: Channel) -> int:
        if channel.id not in self._channel_ids:
            self._channel_ids[channel.id] = self._writer.register_channel(
                topic=channel.topic,
                message_encoding=channel.message_encoding,
                schema_id=self._new_schema_id(channel.schema_id),
                metadata=channel.metadata,
            )
        return self._channel_ids[channel.id]

    def _new_schema_id(self, schema_id: int) -> int:
        if schema_id not in self._schema_ids:
            schema = self._source.schemas.get(schema_id)
            if schema is None:  # it was in a damaged chunk; the messages are kept without it
                return 0
            self._schema_ids[schema_id] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
        return self._schema_ids[schema_id]
