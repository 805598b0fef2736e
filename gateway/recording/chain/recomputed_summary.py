"""The end of a closed recording, computed again from the records before it, which are signed."""

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from gateway.recording.format.frames import INDEX_HEAD, TIME_AND_OFFSET_BYTES, ChunkReader, Frame, records_of
from gateway.recording.format.salvage import PARSERS
from gateway.recording.format.summary_section import SummarySection


class RecomputedSummary:
    """Takes the records of the data section in their order; raises the exceptions `DAMAGED` for those that cannot be read."""

    def __init__(self, file_bytes: int) -> None:
        self._section = SummarySection()
        self._chunks = ChunkReader(file_bytes)
        self._unread: Chunk | None = None
        """The last chunk, whose schemas and channels are not known yet."""
        self._schemas: set[int] = set()
        self._channels: set[int] = set()

    def observe(self, frame: Frame, place: int) -> None:
        """Add a record."""
        head, opcode, content = frame
        length = len(head) + len(content)
        if opcode == Opcode.MESSAGE_INDEX:
            self._add_message_index(content, place, length)
            return
        record = PARSERS[opcode](content) if opcode in PARSERS else None
        match record:
            case Metadata():
                self._section.add_metadata(record, place, length)
            case Attachment():
                self._section.add_attachment(record, place, length)
            case Chunk():
                self._section.add_chunk(record, place, length)
                self._unread = record
            case _:
                pass

    def end(self, start: int, found: bytes) -> bytes:
        """Return the bytes that follow the data section; `found` are those that do."""
        if not self._section.chunk_count:  # no message was recorded, and the definitions stand here alone
            for opcode, content in records_of(found):
                self._define(opcode, content)
        return self._section.encode(start) + MCAP0_MAGIC

    def _add_message_index(self, content: bytes, place: int, length: int) -> None:
        channel_id, entries_bytes = INDEX_HEAD.unpack_from(content)
        if self._unread is not None and channel_id not in self._channels:
            for opcode, definition in self._chunks.frames(self._unread):
                self._define(opcode, definition)
            self._unread = None
        self._section.add_message_index(channel_id, entries_bytes // TIME_AND_OFFSET_BYTES, place, length)

    def _define(self, opcode: int, content: bytes) -> None:
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            return
        record = PARSERS[opcode](content)
        if isinstance(record, Schema) and record.id not in self._schemas:
            self._schemas.add(record.id)
            self._section.schemas.append(record)
        elif isinstance(record, Channel) and record.id not in self._channels:
            self._channels.add(record.id)
            self._section.channels.append(record)
