"""Trimming: of a segment that the quota would take, the time around its events is kept."""

import json
import os
from dataclasses import asdict
from pathlib import Path

from gateway.atomic_io import replace_file
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import DELETIONS, SIGNATURE
from gateway.recording.format.header import TRIMMED
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.reading.segment_index import read_index
from gateway.recording.segments.compaction import CompactionError, HashingFile
from gateway.recording.segments.copying import RecordCopier
from gateway.recording.segments.events import note_trimmed, read_event_intervals
from gateway.topics import paths_with

ALWAYS_KEPT = paths_with(lambda topic: topic.always_kept)
BLOCK_NS = 1_000_000_000
"""A block of samples has the time of its newest one: whole blocks are kept where they may begin in the interval. Basis: a choice;
blocks are shorter than a second at all usual rates."""


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
        sink = HashingFile(file)
        writer = McapWriter(sink, DENSE)
        copier = RecordCopier(writer, losses, keep_around)
        with open_mcap(path) as source:
            copier.copy(read_records(source, losses))
        if losses != SalvageReport(closed=True) or not copier.messages:
            raise CompactionError(f"{path}: is incomplete or damaged, and is not trimmed")
        kept = json.dumps([asdict(interval) for interval in intervals])
        writer.add_metadata(TRIMMED, {"stretches": kept, "whole_bytes": str(size_bytes)})
        if chain is not None and statement is not None:
            writer.add_metadata(DELETIONS, chain.deletions)
            writer.flush()
            signature = chain.trimmed(
                statement, n_bytes=sink.tell(), sha256=sink.sha256, from_ns=copier.from_ns, to_ns=copier.to_ns
            )
            writer.add_metadata(SIGNATURE, signature)
        writer.finish()
    if chain is not None and signature:
        chain.commit(json.loads(signature["statement"])["segment"], signature)
    note_trimmed(path)
    return losses
