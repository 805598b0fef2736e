"""Which files of an archive count, so that nothing counts twice, whatever was uploaded when.

The answer depends on the files alone, never on the order in which they came or on any clock.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gateway.archive.rows import RecordingRow, Status, Trust

TRUST_RANK: dict[Trust, int] = {"refused": 0, "unsigned": 1, "consistent": 2, "verified": 3}
"""Definition: the order of the answers."""


@dataclass(frozen=True, slots=True)
class IndexedFile:
    """A file with what all tables say of a recording."""

    gateway: tuple[str, str, str] | None
    recording: str
    """SHA-256 of the file."""
    trust: Trust
    utc_ns: int
    """Of the first message."""
    row: RecordingRow


def judge_files(files: Iterable[IndexedFile]) -> list[IndexedFile]:
    """Return the files of one gateway with their status.

    Of equal files the first name counts. Of several versions of a segment of one start of the gateway, signed by the same key or
    not signed, the best one counts: first by trust, then the whole segment before a cut or a trimmed one, then the longest.
    What was deleted comes back under no name and in no other version.
    """
    files = list(files)
    reasons = {
        name: each.row.reason
        for each in files
        if each.row.status == "deleted"
        for name in (each.recording, segment_of(each))
    }
    by_content: dict[str, list[IndexedFile]] = defaultdict(list)
    for file in sorted(files, key=lambda each: each.row.path):
        by_content[file.recording].append(file)
    firsts = [same[0] for same in by_content.values()]
    winners = {file.recording for file in _winners([each for each in firsts if each.trust != "refused"])}
    judged = []
    for same in by_content.values():
        for place, file in enumerate(same):
            status: Status = "counted" if file.recording in winners else "superseded"
            reason = reasons.get(file.recording, reasons.get(segment_of(file)))
            if file.trust == "refused":
                status = "refused"
            elif reason is not None:
                status = "deleted"
            elif place:
                status = "copy"
            row = replace(file.row, status=status, reason=file.row.reason if reason is None else reason)
            judged.append(replace(file, row=row))
    return judged


def segment_of(file: IndexedFile) -> object:
    """Return by what the versions of a segment are known."""
    row = file.row
    return file.recording if row.segment is None else (row.boot_id, row.segment)


def _winners(files: Sequence[IndexedFile]) -> list[IndexedFile]:
    groups: dict[object, list[IndexedFile]] = defaultdict(list)
    for file in files:
        groups[segment_of(file)].append(file)
    winners = []
    for versions in groups.values():
        keys = {file.row.public_key for file in versions} - {""}
        for key in keys or {""}:
            winners.append(max((file for file in versions if file.row.public_key in (key, "")), key=_worth))
    return winners


def _worth(file: IndexedFile) -> tuple[int, bool, bool, int, str]:
    row = file.row
    return TRUST_RANK[file.trust], not row.is_trimmed, row.is_final, row.size_bytes, file.recording
