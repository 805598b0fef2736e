"""Compaction: the rewriting of an ended segment in long chunks, which take half the bytes of chunks that are synced each second.

The messages, their order and everything else stay the same. The new file takes the place of the old one in one step, after it was
read again and found to have the same content.

Trimming keeps the time around the events of a segment that the quota would take.
"""

import hashlib
import json
import os
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import BinaryIO

from mcap.records import Attachment, Channel, McapRecord, Message

from devices.errors import RecordingError
from gateway.atomic_io import partial_of, replace_file
from gateway.pki.signing_key import KeyFileError
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import DELETIONS, SIGNATURE, Statement
from gateway.recording.format.content import ORIGIN, REPAIRED, TRIMMED, segment_number
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.reading.recording_file import read_index
from gateway.recording.segments.copying import KeepMessage, RecordCopier
from gateway.recording.segments.events import note_trimmed, read_event_intervals, uncompacted_marker
from gateway.topics import paths_with

TIMES = struct.Struct("<IQQ")
ALWAYS_KEPT = paths_with(lambda topic: topic.always_kept)
CHECKPOINT_BYTES = 65_536
"""Shortest distance of two signatures in a compacted segment. Basis: every chunk is longer, so that one follows each; where the
end of a segment is lost, what is before stays proved to within a chunk."""
BLOCK_NS = 1_000_000_000
"""A block of samples has the time of its newest one: whole blocks are kept where they may begin in the interval. Basis: a choice;
blocks are shorter than a second at all usual rates."""


class CompactionError(RecordingError):
    """A segment stays as it is: a part of it is damaged, or its copy was not the same."""


def compact(path: Path, chain: SegmentChain | None = None) -> SalvageReport:
    """Rewrite an ended segment; return what an interruption has cost of it. Raises `RecordingError` and `OSError`.

    With a chain, a signature follows each chunk of the new file, and the final one ends it. A damaged segment is not rewritten,
    since more of it might be readable by other means, and one that differs from what was signed while it was written is never
    signed as a whole.
    """
    before_repair = None if chain is None else _require_signed(path, chain)
    losses = SalvageReport()
    signature: dict[str, str] = {}
    with replace_file(path) as descriptor:
        with os.fdopen(descriptor, "wb", closefd=False) as file:
            copy = SegmentCopy(file, losses)
            before = ContentDigest()
            with open_mcap(path) as source:
                records = before.observe(read_records(source, losses))
                signed = records if chain is None else copy.checkpointed(records, chain, path.name)
                copy.records.copy(signed, with_summary=True)
            if losses.damaged_records or losses.unreadable_messages or losses.altered or not copy.records.messages:
                raise CompactionError(
                    f"{path}: is damaged or empty, and stays as it is; `plumbline record recover` reads it"
                )
            if not losses.closed:
                copy.writer.add_metadata(REPAIRED, {name: json.dumps(value) for name, value in asdict(losses).items()})
            segment = copy.segment
            if chain is not None and segment:
                repaired_from_ns = None if losses.closed or before_repair is None else before_repair.to_ns
                whole = partial(chain.sign, "final", segment=segment, name=path.name, repaired_from_ns=repaired_from_ns)
                signature = copy.add_signature(chain, whole)
            copy.writer.finish()
        if _digest(partial_of(path)) != before.value:
            raise CompactionError(
                f"{path}: stays as it is, because its copy was not the same; check the memory and the disk"
            )
    if chain is not None and signature:
        chain.commit(segment, signature)
    uncompacted_marker(path).unlink(missing_ok=True)
    return losses


def _require_signed(path: Path, chain: SegmentChain) -> Statement | None:
    """Return the last statement in a segment that is as this gateway signed it; None where it has no number in the chain.

    Raises `CompactionError`.
    """
    from gateway.recording.chain.file_verification import verify_file

    try:
        found = verify_file(path, "" if chain.key is None else chain.key.public_hex)
    except KeyFileError as error:
        raise CompactionError(f"{path}: stays as it is: {error}") from error
    if found.segment is None and found.statement is None:
        return None
    if found.problems:
        raise CompactionError(f"{path}: differs from what was signed, and stays as it is: {found.problems[0]}")
    return found.statement


class SegmentCopy:
    """A copy of a segment in long chunks, with the SHA-256 of what was written to its file."""

    def __init__(self, file: BinaryIO, losses: SalvageReport, keep: KeepMessage | None = None) -> None:
        """`losses` and `keep` as of `RecordCopier`."""
        self._file = file
        self._hash = hashlib.sha256()
        self.writer = McapWriter(self, DENSE)
        self.records = RecordCopier(self.writer, losses, keep)

    def write(self, data: bytes) -> int:
        """Append data."""
        self._hash.update(data)
        return self._file.write(data)

    def tell(self) -> int:
        """Return the number of bytes so far."""
        return self._file.tell()

    @property
    def segment(self) -> int:
        """The number of the segment, as far as it is copied; 0: it has none."""
        return segment_number(self.records.metadata.get(ORIGIN, {}))

    def checkpointed(self, records: Iterable[McapRecord], chain: SegmentChain, name: str) -> Iterator[McapRecord]:
        """Yield the records to the copier, and add a signature of everything so far behind each chunk that it has written."""
        sign = partial(chain.sign, "checkpoint", name=name)
        signed_bytes = 0
        for record in records:
            yield record
            if self.segment and self.tell() - signed_bytes >= CHECKPOINT_BYTES:
                self._sign(partial(sign, segment=self.segment))
                signed_bytes = self.tell()

    def add_signature(self, chain: SegmentChain, sign: Callable[..., dict[str, str]]) -> dict[str, str]:
        """Add what was deleted, and the signature of everything so far; return it. `sign` takes length, hash and times."""
        self.writer.add_metadata(DELETIONS, chain.deletions)
        self.writer.flush()
        return self._sign(sign)

    def _sign(self, sign: Callable[..., dict[str, str]]) -> dict[str, str]:
        signature = sign(
            n_bytes=self.tell(),
            sha256=self._hash.hexdigest(),
            from_ns=self.records.from_ns,
            to_ns=self.records.to_ns,
        )
        self.writer.add_metadata(SIGNATURE, signature)
        return signature


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


def trim(path: Path, chain: SegmentChain | None = None) -> SalvageReport:
    """Keep of a closed segment what is around its events. Raises `RecordingError` and `OSError`; the segment then stays."""
    intervals = read_event_intervals(path)
    size_bytes = path.stat().st_size

    def keep_around(topic: str, time_ns: int) -> bool:
        return topic in ALWAYS_KEPT or any(each.from_ns <= time_ns <= each.to_ns + BLOCK_NS for each in intervals)

    losses = SalvageReport()
    signature: dict[str, str] = {}
    statement = read_index(path).metadata.get(SIGNATURE, {}).get("statement")
    with replace_file(path) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
        copy = SegmentCopy(file, losses, keep_around)
        with open_mcap(path) as source:
            copy.records.copy(read_records(source, losses))
        if losses != SalvageReport(closed=True) or not copy.records.messages:
            raise CompactionError(f"{path}: is incomplete or damaged, and is not trimmed")
        kept = json.dumps([asdict(interval) for interval in intervals])
        copy.writer.add_metadata(TRIMMED, {"stretches": kept, "whole_bytes": str(size_bytes)})
        if chain is not None and statement is not None:
            signature = copy.add_signature(chain, partial(chain.trimmed, statement))
        copy.writer.finish()
    if chain is not None and signature:
        chain.commit(json.loads(signature["statement"])["segment"], signature)
    note_trimmed(path)
    return losses
