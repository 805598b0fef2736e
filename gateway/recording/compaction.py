"""Compaction: the rewriting of an ended segment in long chunks, which take half the bytes of chunks that are synced each second.

The messages, their order and everything else stay the same. The new file takes the place of the old one in one step, after it was
read again and found to have the same content.
"""

import hashlib
import json
import os
import struct
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from mcap.records import Attachment, Channel, McapRecord, Message

from devices.errors import RecordingError
from gateway.atomic_io import partial_of, replace_file
from gateway.recording.copying import RecordCopier
from gateway.recording.header import REPAIRED
from gateway.recording.mcap_salvage import SalvageReport, open_mcap, read_records
from gateway.recording.mcap_writer import DENSE, McapWriter
from gateway.recording.retention import uncompacted_marker

TIMES = struct.Struct("<IQQ")


class CompactionError(RecordingError):
    """A segment stays as it is: a part of it is damaged, or its copy was not the same."""


def compact(path: Path) -> SalvageReport:
    """Rewrite an ended segment; return what an interruption has cost of it. Raises `RecordingError` and `OSError`.

    A damaged segment is not rewritten, since more of it might be readable by other means.
    """
    losses = SalvageReport()
    with replace_file(path) as descriptor:
        with os.fdopen(descriptor, "wb", closefd=False) as file:
            writer = McapWriter(file, DENSE)
            copier = RecordCopier(writer, losses)
            before = ContentDigest()
            with open_mcap(path) as source:
                copier.copy(before.observe(read_records(source, losses)))
            if losses.damaged_records or losses.unreadable_messages or losses.altered or not copier.messages:
                raise CompactionError(
                    f"{path}: is damaged or empty, and stays as it is; `plumbline record recover` reads it"
                )
            if not losses.closed:
                writer.add_metadata(REPAIRED, {name: json.dumps(value) for name, value in asdict(losses).items()})
            writer.finish()
        if _digest(partial_of(path)) != before.value:
            raise CompactionError(
                f"{path}: stays as it is, because its copy was not the same; check the memory and the disk"
            )
    uncompacted_marker(path).unlink(missing_ok=True)
    return losses


def _digest(path: Path) -> bytes:
    digest, losses = ContentDigest(), SalvageReport()
    with open_mcap(path) as file:
        for _ in digest.observe(read_records(file, losses)):
            pass
    return digest.value if losses == SalvageReport(closed=True) else b""


class ContentDigest:
    """The hashes of the messages and of the attachments of a recording, each in their order, whatever its chunks are."""

    def __init__(self) -> None:
        self._messages = hashlib.sha256()
        self._attachments = hashlib.sha256()
        self._topics: dict[int, bytes] = {}

    @property
    def value(self) -> bytes:
        """Both hashes so far."""
        return self._messages.digest() + self._attachments.digest()

    def observe(self, records: Iterable[McapRecord]) -> Iterable[McapRecord]:
        """Yield the records, and add them to the hashes."""
        for record in records:
            match record:
                case Message():
                    self._messages.update(self._topics.get(record.channel_id, b""))
                    self._messages.update(TIMES.pack(record.sequence, record.log_time, record.publish_time))
                    self._messages.update(record.data)
                case Channel():
                    self._topics[record.id] = record.topic.encode()
                case Attachment():
                    self._attachments.update(record.name.encode())
                    self._attachments.update(record.data)
                case _:
                    pass
            yield record
