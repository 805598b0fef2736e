"""The indexing of recordings: what is new in a source is verified, read, and put into the tables.

The work may be done several times, by several processes at once, and be ended at any moment; each row is there once. The table of
recordings is written last and decides what counts.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import pyarrow as pa

from gateway.archive.admission import Admission, KeyOf, admit
from gateway.archive.rows import RECORDINGS, TABLES, RecordingRow, schema_of
from gateway.archive.source import RecordingSource, StoredFile
from gateway.archive.tables import (
    MAX_ATTEMPTS,
    NO_GATEWAY,
    Archive,
    ArchiveError,
    partition_of,
    recordings_table,
    row_places,
    table_of,
)
from gateway.archive.versions import IndexedFile, judge_files
from gateway.recording.reading.timeline import ReportProgress, ignore_progress

BATCH_FILES = 144
"""Files of one transaction. Basis: a day of segments of ten minutes; a transaction costs a second on an object store, and a kill
loses the work of one."""
MAX_HELD_FILES = 600
"""Files that are held before some are written. Basis: a choice; at 0.2 MB each, a bound of the memory."""

Gateway = tuple[str, str, str] | None


@dataclass(frozen=True, slots=True)
class NewFile:
    """A file that was read, with its rows by table."""

    file: IndexedFile
    tables: dict[str, pa.Table]


@dataclass(slots=True)
class IndexResult:
    """What a run has done."""

    files: int = 0
    """Files in the source."""
    read: list[IndexedFile] = field(default_factory=list)
    """Those that were new, with their status at the end of their transaction."""


def index(
    source: RecordingSource, archive: Archive, key_of: KeyOf, report: ReportProgress = ignore_progress
) -> IndexResult:
    """Put what is new in a source into the tables. Raises `InputError`, `ArchiveError` and `KeyFileError`."""
    listed = source.list()
    archive.create()
    known: dict[str, list[IndexedFile]] = defaultdict(list)
    for file in archive.files(archive.open(RECORDINGS)):
        known[file.row.path].append(file)
    result = IndexResult(len(listed))
    held: dict[Gateway, list[NewFile]] = defaultdict(list)
    for number, stored in enumerate(listed):
        report(number / len(listed))
        if not _is_new(stored, known[stored.path], key_of):
            continue
        with source.local(stored.path) as path:
            new = _new_file(stored, admit(path, key_of))
        held[new.file.gateway].append(new)
        if len(held[new.file.gateway]) >= BATCH_FILES or sum(map(len, held.values())) >= MAX_HELD_FILES:
            fullest = max(held, key=lambda gateway: len(held[gateway]))
            result.read += commit(archive, fullest, held.pop(fullest))
    for gateway, files in held.items():
        result.read += commit(archive, gateway, files)
    taken = {file.row.path for file in result.read if file.gateway is not None}
    if refused_before := [path for path in taken if any(file.gateway is None for file in known[path])]:
        commit(archive, None, [], refused_before)
    report(1.0)
    return result


def commit(
    archive: Archive, gateway: Gateway, new: Sequence[NewFile], forgotten: Sequence[str] = ()
) -> list[IndexedFile]:
    """Put files of one gateway into the tables, and forget the files of some names; return the former with their status."""
    writer = NO_GATEWAY if gateway is None else "/".join(gateway)
    for _ in range(MAX_ATTEMPTS):
        table = archive.open(RECORDINGS)
        before = {file.row.path: file for file in archive.files(table, writer)}
        kept = {path: file for path, file in before.items() if path not in forgotten}
        fresh = {each.file.row.path: each.file for each in new}
        after = {file.row.path: file for file in judge_files({**kept, **fresh}.values())}
        _exchange_rows(archive, writer, before, after, new)
        changed = [path for path in {**before, **after} if before.get(path) != after.get(path)]
        versions = [known[path] for path in changed for known in (before, after) if path in known]
        months = sorted({partition_of(RECORDINGS, file.utc_ns) for file in versions})
        places = row_places(RECORDINGS, writer, changed if before else [], months)
        if archive.replace(table, writer, places, recordings_table([after[path] for path in changed if path in after])):
            return [after[path] for path in fresh]
    raise ArchiveError(f"{archive.place}: others are indexing {writer} all the time; try again later")


def _exchange_rows(
    archive: Archive,
    writer: str,
    before: dict[str, IndexedFile],
    after: dict[str, IndexedFile],
    new: Sequence[NewFile],
) -> None:
    """Put the rows of the new files that count into the tables, and take out those of files that do not count."""
    counted = {file.recording for file in after.values() if file.row.status == "counted"}
    written = {each.file.recording: each for each in new if each.file.recording in counted}
    read = [each.file for each in new if each.file.trust != "refused"]
    gone = [file for file in before.values() if file.row.status == "counted" and file.recording not in counted]
    touched = {file.recording: file for file in (*read, *gone)}
    if not touched:
        return
    for name in TABLES:
        partitions = sorted({partition_of(name, file.utc_ns) for file in touched.values()})
        rows = (
            pa.concat_tables([each.tables[name] for each in written.values()])
            if written
            else schema_of(name).empty_table()
        )
        archive.exchange(name, writer, row_places(name, writer, list(touched), partitions), rows)


def _is_new(stored: StoredFile, known: Sequence[IndexedFile], key_of: KeyOf) -> bool:
    """Return whether a file was not read yet, has changed, or may now be judged by another key."""
    file = next((each for each in known if each.row.version == stored.version), None)
    if file is None:
        return True
    if file.gateway is None:
        return bool(file.row.given_key)  # refused by a key that may have been the wrong one
    key = key_of("/".join(file.gateway))
    return key is not None and key != file.row.given_key


def _new_file(stored: StoredFile, found: Admission) -> NewFile:
    rows = found.rows
    offset_ns = 0 if rows is None else rows.wall_offset_ns
    row = RecordingRow(
        path=stored.path,
        version=stored.version,
        gateway_time_ns=0 if rows is None else rows.from_ns,
        end_utc=0 if rows is None else rows.to_ns + offset_ns,
        size_bytes=stored.size_bytes,
        status="refused" if rows is None else "counted",
        reason=found.reason,
        segment=found.segment,
        boot_id=found.boot_id,
        software=found.software,
        public_key=found.public_key,
        given_key=found.given_key,
        statement_sha256=found.statement_sha256,
        previous_sha256=found.previous_sha256,
        is_final=found.is_final,
        is_trimmed=found.is_trimmed,
        unreadable=0 if rows is None else rows.losses.unreadable_messages + rows.losses.damaged_records,
    )
    utc_ns = row.gateway_time_ns + offset_ns
    file = IndexedFile(found.gateway, found.sha256, found.trust, utc_ns, row)
    tables = {} if rows is None else {name: table_of(name, rows.rows[name], file, offset_ns) for name in TABLES}
    return NewFile(file, tables)
