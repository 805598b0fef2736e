"""Offline verification of the segments of a gateway together: none removed, none exchanged, none with a clock set back."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any

from gateway.recording.chain import Statement, hash_of
from gateway.recording.chain_state import STATE_NAME, ChainStateError, read_state
from gateway.recording.signing_key import fingerprint
from gateway.recording.timestamp import iso_utc
from gateway.recording.verification import FileVerification

LATEST_NS = 2_000_000_000
"""Samples may be recorded so much later than messages about the gateway itself, so that neighbouring segments overlap."""


@dataclass(frozen=True, slots=True)
class ChainVerification:
    """What was found in files of one gateway."""

    files: tuple[FileVerification, ...]
    """In the order of their numbers; those without one at the end."""
    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    public_keys: tuple[str, ...]

    @property
    def is_genuine(self) -> bool:
        """Whether nothing differs from what the gateway stated."""
        return not self.problems and not any(file.problems for file in self.files)

    def as_json(self) -> dict[str, Any]:
        """Return the content of `record verify --json`."""
        return {
            "genuine": self.is_genuine,
            "problems": list(self.problems),
            "remarks": list(self.remarks),
            "public_keys": list(self.public_keys),
            "files": [_file_json(file) for file in self.files],
        }


def verify_chain(files: Sequence[FileVerification], folders: Sequence[Path] = ()) -> ChainVerification:
    """Compare the statements of files with each other; `folders` are given as a whole, with the newest segment."""
    numbered = sorted((file for file in files if file.segment is not None), key=lambda file: file.segment or 0)
    others = [file for file in files if file.segment is None]
    stated = [(file, file.statement) for file in numbered if file.statement is not None]
    problems, remarks = [], []
    keys = tuple(dict.fromkeys(statement.public_key for _, statement in stated if statement.public_key))
    if len(keys) > 1:
        problems.append(f"WRONG KEY: {len(keys)} keys have signed: {', '.join(map(fingerprint, keys))}")
    problems += _exchanged(numbered)
    deleted_up_to = max((statement.deleted_up_to for _, statement in stated), default=0)
    for (before, first), (after, second) in pairwise(stated):
        problems += _between(before, first, after, second)
    missing = _missing(numbered)
    if removed := [part for gap in missing if (part := range(max(gap.start, deleted_up_to + 1), gap.stop))]:
        problems.append(f"REMOVED: {_list(removed)} missing; the quota has deleted none above {deleted_up_to}")
    if deleted := [part for gap in missing if (part := range(gap.start, min(gap.stop, deleted_up_to + 1)))]:
        remarks.append(f"{_list(deleted)} missing, which the quota may have deleted")
    for number in sorted({statement.rebuilt_before for _, statement in stated} - {0}):
        remarks.append(
            f"before segment {number} the gateway had lost {STATE_NAME} and went on from its recordings: "
            "whether later ones had been there, and what the quota had just deleted, cannot be proved"
        )
    for folder in folders:
        _check_newest([file for file in numbered if file.path.parent == folder], folder, problems, remarks)
    return ChainVerification((*numbered, *others), tuple(problems), tuple(remarks), keys)


def _exchanged(numbered: Sequence[FileVerification]) -> list[str]:
    """Return a problem for each pair of files with the same number, or whose names are not in the order of their numbers."""
    problems = []
    for before, after in pairwise(numbered):
        if before.segment == after.segment:
            problems.append(f"COPIED: {before.path.name} and {after.path.name} are both segment {after.segment}")
        elif before.path.parent == after.path.parent and before.path.name > after.path.name:
            problems.append(
                f"EXCHANGED: {after.path.name} is segment {after.segment}, {before.path.name} segment {before.segment}"
            )
    return problems


def _between(before: FileVerification, first: Statement, after: FileVerification, second: Statement) -> list[str]:
    """Return what is wrong between two neighbours."""
    problems = []
    if second.gateway != first.gateway:
        problems.append(f"{after.path.name}: is of {second.gateway}, {before.path.name} of {first.gateway}")
    follows = second.previous_segment == first.segment and before.is_final
    if follows and second.previous_sha256 not in (hash_of(before.statement_text), first.replaces_sha256):
        problems.append(f"EXCHANGED: {after.path.name} does not follow this {before.path.name}, but another one")
    if second.from_ns < first.to_ns - LATEST_NS and after.segment != before.segment:
        back_s = (first.to_ns - second.from_ns) / 1e9
        problems.append(
            f"CLOCK SET BACK by {back_s:.3f} s: {after.path.name} begins at {iso_utc(second.from_ns)}, "
            f"{before.path.name} ended at {iso_utc(first.to_ns)}"
        )
    return problems


def _missing(numbered: Sequence[FileVerification]) -> list[range]:
    found = sorted({file.segment for file in numbered if file.segment is not None})
    return [range(before + 1, after) for before, after in pairwise(found) if after > before + 1]


def _check_newest(numbered: Sequence[FileVerification], folder: Path, problems: list[str], remarks: list[str]) -> None:
    """Add what is wrong, or not known, of the segments that a gateway wrote last into a folder."""
    try:
        state, reason = read_state(folder), f"{folder}: has no {STATE_NAME}"
    except ChainStateError as error:
        state, reason = None, str(error)
    newest = max((file.segment or 0 for file in numbered), default=0)
    if state is not None and newest < state.final_segment:
        removed = range(newest + 1, state.final_segment + 1)
        problems.append(f"REMOVED: {_list([removed])} missing at the end of {folder}")
    elif state is None and any(file.is_final for file in numbered):
        remarks.append(f"{reason}: whether segments after {newest} were removed cannot be proved")


def _list(missing: Sequence[range]) -> str:
    count = sum(map(len, missing))
    shown = ", ".join(map(str, islice(chain.from_iterable(missing), 8))) + (
        f" and {count - 8} more" if count > 8 else ""
    )
    return f"segment {shown} is" if count == 1 else f"segments {shown} are"


def _file_json(file: FileVerification) -> dict[str, Any]:
    statement = file.statement
    return {
        "path": str(file.path),
        "segment": file.segment,
        "kind": None if statement is None else statement.kind,
        "signed_bytes": 0 if statement is None else statement.bytes,
        "size_bytes": file.size_bytes,
        "signed_up_to_ns": None if statement is None else statement.to_ns,
        "problems": file.problems,
        "remarks": file.remarks,
    }
