"""The indexing of recordings: what is new in a source is verified, read, and put into the tables.

The work may be done several times, by several processes at once, and be ended at any moment; each row is there once. The table of
recordings is written last and decides what counts.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import pyarrow as pa

from gateway.archive.admission import Authority, KeyOf, admit, judge_files
from gateway.archive.rows import RECORDINGS, TABLES, IndexedFile, schema_of
from gateway.archive.segment_rows import SegmentRows
from gateway.archive.source import RecordingSource, StoredFile
from gateway.archive.tables import (
    MAX_ATTEMPTS,
    NO_GATEWAY,
    Archive,
    ArchiveError,
    partition_of,
    recordings_table,
    row_places,
    select,
    table_of,
    without_names,
)
from gateway.recording.reading.timeline import ReportProgress, ignore_progress

BATCH_FILES = 500
"""Files of one transaction, of whatever gateways. Basis: a choice; at 0.2 MB each a bound of the memory, a kill loses the work of
minutes, and a transaction in each table costs a second on an object store."""

Key = tuple[str, str]
"""Gateway and name of a file: one that was refused under a name may be followed by one that is not."""
Files = dict[Key, IndexedFile]


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
    source: RecordingSource,
    archive: Archive,
    key_of: KeyOf,
    authority: Authority | None = None,
    report: ReportProgress = ignore_progress,
) -> IndexResult:
    """Put what is new in a source into the tables. Raises `InputError`, `ArchiveError` and `KeyFileError`."""
    listed = source.list()
    archive.create()
    known, key_of = _known_files(archive), cache(key_of)
    result = IndexResult(len(listed))
    batch: list[NewFile] = []
    for number, stored in enumerate(listed):
        report(number / len(listed))
        if not _is_new(stored, known[stored.path], key_of, authority):
            continue
        with source.local(stored.path) as path:
            file, rows = admit(stored, path, key_of, authority)
        batch.append(NewFile(file, {} if rows is None else _tables(file, rows)))
        if len(batch) == BATCH_FILES:
            result.read += commit(archive, batch)
            batch = []
    result.read += commit(archive, batch)
    report(1.0)
    return result


def _tables(file: IndexedFile, rows: SegmentRows) -> dict[str, pa.Table]:
    return {name: table_of(name, rows.rows[name], file, rows.wall_offset_ns) for name in TABLES}


def commit(archive: Archive, new: Sequence[NewFile]) -> list[IndexedFile]:
    """Put files into the tables; return them with their status."""
    fresh = {_key(each.file): each.file for each in new}
    taken = {path for writer, path in fresh if writer != NO_GATEWAY}

    def with_new(before: Files) -> Files:
        kept = {key: file for key, file in before.items() if key[0] != NO_GATEWAY or key[1] not in taken}
        read = {key: _as_decided(file, before.get(key)) for key, file in fresh.items()}
        return _judged({**kept, **read})

    after = change_files(archive, {writer for writer, _ in fresh} | {NO_GATEWAY}, with_new, new)
    return [after[key] for key in fresh]


def change_files(
    archive: Archive, writers: Collection[str], change: Callable[[Files], Files], new: Sequence[NewFile] = ()
) -> Files:
    """Change what is known of the files of gateways, and the rows of recordings with it; return what is known then.

    `new` are files whose rows may come in. `change` is asked again where another writer has been faster. Raises `ArchiveError`.
    """
    for _ in range(MAX_ATTEMPTS):
        table = archive.open(RECORDINGS)
        before = {_key(file): file for file in archive.files(table, writers)}
        before = {key: file for key, file in before.items() if key[0] in writers}
        after = change(before)
        _exchange_rows(archive, before, after, new)
        changed = [key for key in {**before, **after} if before.get(key) != after.get(key)]
        if not changed:
            return after
        versions = [known[key] for key in changed for known in (before, after) if key in known]
        months = [partition_of(RECORDINGS, file) for file in versions]
        replaced = [path for _, path in changed] if any(key in before for key in changed) else []
        places = row_places(RECORDINGS, {writer for writer, _ in changed}, replaced, months)
        if archive.replace(table, places, recordings_table([after[key] for key in changed if key in after])):
            return after
    raise ArchiveError(f"{archive.place}: others are indexing the same gateways all the time; try again later")


def _as_decided(file: IndexedFile, before: IndexedFile | None) -> IndexedFile:
    """Return a file that was read, with what was deleted of it when it was known under its name before."""
    if before is None:
        return file
    kept = replace(file.row, nameless=before.row.nameless)
    if before.row.status == "deleted":
        kept = replace(kept, status="deleted", reason=before.row.reason)
    return replace(file, row=kept)


def _judged(files: Files) -> Files:
    by_writer: dict[str, list[IndexedFile]] = defaultdict(list)
    for (writer, _), file in files.items():
        by_writer[writer].append(file)
    return {_key(file): file for own in by_writer.values() for file in judge_files(own)}


def _key(file: IndexedFile) -> Key:
    return NO_GATEWAY if file.gateway is None else "/".join(file.gateway), file.row.path


def _exchange_rows(archive: Archive, before: Files, after: Files, new: Sequence[NewFile]) -> None:
    """Put the rows of the new files that count into the tables, and take out those of files that do not count."""
    counted = {file.recording for file in after.values() if file.row.status == "counted"}
    settled = {key for key in after if before.get(key) == after[key] and after[key].row.status == "counted"}
    unread = [each for each in new if each.file.trust != "refused" and _key(each.file) not in settled]
    written = {each.file.recording: each for each in unread if each.file.recording in counted}
    gone = [file for file in before.values() if file.row.status == "counted" and file.recording not in counted]
    touched = {file.recording: file for file in (*(each.file for each in unread), *gone)}
    if not touched:
        return
    writers = {_key(file)[0] for file in touched.values()}
    nameless = {file.recording for file in after.values() if file.row.nameless}
    for name in TABLES:
        partitions = [partition_of(name, file) for file in touched.values()]
        parts = [
            without_names(name, each.tables[name]) if one in nameless else each.tables[name]
            for one, each in written.items()
        ]
        rows = pa.concat_tables([schema_of(name).empty_table(), *parts])
        archive.exchange(name, row_places(name, writers, list(touched), partitions), rows)


@dataclass(frozen=True, slots=True)
class KnownFile:
    """What decides whether a file is read again."""

    version: str
    gateway: str | None
    given_key: str
    asked_ca: str


def _known_files(archive: Archive) -> dict[str, list[KnownFile]]:
    """Return what the table knows of each name."""
    columns = select(archive.open(RECORDINGS), "path, version, site, crane, sensor, given_key, asked_ca", "true")
    known: dict[str, list[KnownFile]] = defaultdict(list)
    for path, version, site, crane, sensor, given_key, asked_ca in zip(
        *(each.to_pylist() for each in columns), strict=True
    ):
        gateway = None if crane is None else f"{site}/{crane}/{sensor}"
        known[path].append(KnownFile(version, gateway, given_key, asked_ca or ""))
    return known


def _is_new(stored: StoredFile, known: Sequence[KnownFile], key_of: KeyOf, authority: Authority | None) -> bool:
    """Return whether a file was not read yet, has changed, or may now be judged by another key."""
    file = next((each for each in known if each.version == stored.version), None)
    if file is None:
        return True
    if file.gateway is None:
        return bool(file.given_key)  # refused by a key that may have been the wrong one
    key = key_of(file.gateway)
    if key is None and authority is not None and not file.given_key:
        return file.asked_ca != authority.sha256
    return key is not None and key != file.given_key
