"""The deletion of old recordings: their rows, their answers and their files go, and what was deleted, by whom and why stays.

Of each recording the table of recordings keeps the hashes of its statement and of the one before: the chain of evidence goes on
over what was deleted. The names of people that the tables have go alone, too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import obstore
from deltalake import CommitProperties
from deltalake.exceptions import CommitFailedError, DeltaError
from obstore.exceptions import BaseError

from gateway.archive.admission import segment_of
from gateway.archive.index import BATCH_FILES, Files, change_files
from gateway.archive.rows import NAMES, RECORDINGS, RESULTS, IndexedFile, schema_of
from gateway.archive.source import DELETED, RecordingSource, reason_of_store
from gateway.archive.tables import MAX_ATTEMPTS, Archive, ArchiveError, row_places, select, sql_in
from gateway.errors import InputError


@dataclass(frozen=True, slots=True)
class DeletionRule:
    """What is deleted: recordings that ended before a time, of all cranes or of one."""

    before: datetime
    crane: str | None = None

    def chosen(self, files: Sequence[IndexedFile]) -> list[IndexedFile]:
        """Return the files that the rule deletes, in the order of their names.

        A segment goes with all its versions, when the last of them is old enough; a file of which nobody knows whose it is stays.
        """
        ends_utc: dict[object, int] = {}
        for file in files:
            segment = (file.gateway, segment_of(file))
            ends_utc[segment] = max(ends_utc.get(segment, 0), file.row.end_utc)
        found = [
            file
            for file in files
            if file.gateway is not None
            and self.crane in (None, file.gateway[1])
            and ends_utc[file.gateway, segment_of(file)] < self.before.timestamp() * 1e9
        ]
        return sorted(found, key=lambda file: file.row.path)


def due(archive: Archive, rule: DeletionRule) -> list[IndexedFile]:
    """Return the files that a rule deletes, also those that were deleted before. Raises `ArchiveError`."""
    return rule.chosen(archive.files(archive.open(RECORDINGS)))


def delete(archive: Archive, source: RecordingSource, rule: DeletionRule, why: str) -> list[IndexedFile]:
    """Delete rows, answers and files; return the files that were deleted now. `why`: when, by whom, for what reason.

    Whatever ends it, it goes on where it was when it is repeated. Raises `ArchiveError` and `InputError`.
    """
    chosen = due(archive, rule)
    archive.create()  # columns that an older table lacks
    fresh = [file for file in chosen if file.row.status != "deleted"]
    for begin in range(0, len(fresh), BATCH_FILES):
        _delete_rows(archive, fresh[begin : begin + BATCH_FILES], why)
    present = {file.path for file in source.list()}
    for file in chosen:
        if file.row.path in present:
            _delete_file(source, file.row.path)
    return fresh


def _delete_rows(archive: Archive, files: list[IndexedFile], why: str) -> None:
    """Delete the rows of some files and the answers that begin with them, and note why."""
    writers = {"/".join(file.gateway or ()) for file in files}
    recordings = {file.recording for file in files}

    def without(before: Files) -> Files:
        return {
            key: replace(file, row=replace(file.row, status="deleted", reason=why))
            if file.recording in recordings and file.row.status != "deleted"
            else file
            for key, file in before.items()
        }

    _delete_answers(archive, files, writers)
    change_files(archive, writers, without)


def _delete_answers(archive: Archive, files: list[IndexedFile], writers: set[str]) -> None:
    """Delete the results of tasks that begin with one of the files."""
    found = select(archive.open(RESULTS), "task, from_month", sql_in("recording", [file.recording for file in files]))
    tasks, months = found["task"].to_pylist(), found["from_month"].to_pylist()
    if tasks:
        archive.exchange(RESULTS, row_places(RESULTS, writers, tasks, months), schema_of(RESULTS).empty_table())


def _delete_file(source: RecordingSource, path: str) -> None:
    try:
        obstore.put(source.store, path + DELETED, b"")
        obstore.delete(source.store, path)
    except (BaseError, OSError) as error:
        raise InputError(
            f"{source.name}/{path}: cannot be deleted ({reason_of_store(error)}); the rows are; repeat it when it may be"
        ) from error


def delete_names(archive: Archive, rule: DeletionRule, why: str) -> int:
    """Empty the columns that may name people, of the rows of a rule, for good; return the number of rows. Raises `ArchiveError`.

    Each transaction has `why`.
    """
    files = due(archive, rule)
    recordings = {file.recording for file in files}
    if not files:
        return 0
    archive.create()  # columns that an older table lacks

    def marked(before: Files) -> Files:
        return {
            key: replace(file, row=replace(file.row, nameless=file.row.nameless or why))
            if file.recording in recordings
            else file
            for key, file in before.items()
        }

    change_files(archive, {"/".join(file.gateway or ()) for file in files}, marked)
    return sum(_emptied(archive, sorted(recordings), why))


def _emptied(archive: Archive, recordings: list[str], why: str) -> Iterator[int]:
    audit = CommitProperties(custom_metadata={"why": why})
    for name, column in NAMES.items():
        condition = f"{column} <> '' AND {sql_in('recording', recordings)}"
        for _ in range(MAX_ATTEMPTS):
            table = archive.open(name)
            try:
                found = table.update(updates={column: "''"}, predicate=condition, commit_properties=audit)
                yield int(found["num_updated_rows"])
                break
            except CommitFailedError:
                continue
            except (DeltaError, OSError) as error:
                raise ArchiveError(f"{table.table_uri}: cannot be written ({reason_of_store(error)})") from error
        else:
            raise ArchiveError(f"{archive.place}: others are writing all the time; try again later")
