"""Which segments of a chain are missing and which files are destroyed: one judgement for every command that reads recordings.

It needs the indexes of the files alone: `record verify` makes it of files that it has read as a whole, the others believe what
stands in them.
"""

from collections.abc import Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path

from gateway.pki.signing_key import KeyFileError
from gateway.recording.chain.chain_files import (
    ChainFiles,
    destroyed_file,
    entire_folders,
    group_by_chain,
    is_data_folder,
    place_destroyed,
)
from gateway.recording.chain.chain_state import STATE_NAME, ChainState, ChainStateError, read_state
from gateway.recording.chain.file_verification import FileVerification
from gateway.recording.chain.statements import (
    DELETIONS,
    NOT_GIVEN,
    REMOVED,
    SIGNATURE,
    DeletionStatement,
    MissingSegments,
    describe_missing,
    has_signature,
    is_forged,
    list_missing,
    name_missing,
    parse_deletions,
    parse_statement,
)
from gateway.recording.format.content import COPIES, segment_number
from gateway.recording.format.salvage import NotMcapError
from gateway.recording.reading.recording_file import EVERYTHING, SegmentIndex, Selection
from gateway.recording.reading.timeline import Timeline

OTHERS = "whether others were removed, an extract cannot tell"
LATER = f"whether later ones were removed, a folder without a sound {STATE_NAME} cannot tell"
LATEST_NS = 2**63
"""Definition: later than any time of a recording."""


@dataclass(frozen=True, slots=True)
class MissingFiles:
    """What is not there of a chain."""

    missing: tuple[MissingSegments, ...] = ()
    """Numbers without a file, in their order. Where files were named, those before and after them are not missed."""
    destroyed: tuple[FileVerification, ...] = ()
    """Files in which nothing of what was recorded can be read."""
    deletions: DeletionStatement = field(default_factory=lambda: DeletionStatement(gateway=""))
    """What the gateway states of its deletions."""
    states: tuple[ChainState, ...] = ()
    """What it has saved in the folders, and signed."""
    forged: tuple[str, ...] = ()
    """What somebody else has written there, as sentences."""
    unproven: tuple[str, ...] = ()
    """Why it cannot be told of a folder whether later ones were removed, each as a clause."""
    remarks: tuple[str, ...] = ()
    """The same as sentences."""
    untold: str = ""
    """What cannot be told of others; empty: none was removed."""
    extract_of: int | None = None
    """The files are a part of the segments 1 to this one at least; None: nothing says that there are others."""
    newest: int = 0
    """The newest number that somebody states; 0: nobody does."""

    @property
    def removed(self) -> list[str]:
        """Sentences about those that somebody has taken away."""
        return describe_missing(self.missing, self.deletions)[0]

    @property
    def deleted(self) -> list[str]:
        """Sentences about those that the gateway has deleted, or may have deleted."""
        return describe_missing(self.missing, self.deletions)[1]

    @property
    def problems(self) -> list[str]:
        """Sentences about what somebody has forged, removed or destroyed."""
        destroyed = (f"{file.path.name}: {text}" for file in self.destroyed for text in file.problems)
        return [*self.forged, *self.removed, *destroyed]

    def beside(self, used: Set[int], readable: Set[int]) -> "MissingFiles":
        """Return what was removed or destroyed next to, or between, the segments that are used of those that can be read."""

        def is_beside(first: int, last: int) -> bool:
            before = max((number for number in readable if number < first), default=0)
            after = min((number for number in readable if number > last), default=0)
            return not used.isdisjoint({before, after} - {0})

        return replace(
            self,
            missing=tuple(each for each in self.missing if each.reason == REMOVED and is_beside(each.first, each.last)),
            destroyed=tuple(
                file
                for file in self.destroyed
                if (used >= readable if file.segment is None else is_beside(file.segment, file.segment))
            ),
        )

    def may_go_on(self, number: int) -> bool:
        """Return whether a start after the last segment may have recorded more: nobody states more, nor that there is none."""
        is_newest = any(state.final_segment == state.newest_segment == number for state in self.states)
        return self.newest <= number and not is_newest

    def following(self, number: int) -> str:
        """Return that what followed the last segment that can be read is not there, as a sentence; empty: nothing says so."""
        lost = [
            f"{name_missing([each])} missing" for each in self.missing if each.reason == REMOVED and each.first > number
        ]
        lost += [
            f"{file.path.name}, segment {file.segment}, is destroyed"
            for file in self.destroyed
            if (file.segment or 0) > number
        ]
        return f"The recordings went on: {', and '.join(lost)}" if lost else ""


def find_missing(
    files: Sequence[FileVerification],
    folders: Sequence[Path] = (),
    heard: Sequence[int] = (),
    remembered: Sequence[int] = (),
    ends_in: Path | None = None,
) -> MissingFiles:
    """Return what is missing of the chain of files, of which those that are destroyed have their places.

    `folders` are given as a whole, from the first to the newest segment, `ends_in` from some segment on to the newest. Numbers
    of segments that were `heard` must be here; what this user has `remembered` need not be in an extract. Raises `KeyFileError`
    where signatures cannot be checked.
    """
    numbered = sorted((file for file in files if file.segment is not None), key=lambda file: file.segment or 0)
    stated = [file for file in numbered if file.statement is not None]
    states, unsound, forged = _read_states(numbered, list(dict.fromkeys([*folders, *filter(None, [ends_in])])))
    deletions, forged_deletions = _join_deletions(stated, states)
    proven = max([0, *(state.final_segment for state in states), *heard])
    newest = max([proven, *remembered])
    numbers = sorted({file.segment for file in numbered if file.segment is not None})
    missing = list_missing(numbers, 1 if folders else numbers[0], newest, deletions) if numbers else ()
    if not any(is_data_folder(folder) for folder in entire_folders(files, folders)):
        missing = tuple(_not_given(missing, proven))
    is_part = any(each.reason == NOT_GIVEN for each in missing)
    is_begun_later = bool(numbers) and not folders and numbers[0] > 1
    return MissingFiles(
        missing,
        tuple(file for file in files if file.is_destroyed),
        deletions,
        tuple(states),
        (*forged, *forged_deletions),
        tuple(each.why for each in unsound),
        tuple(each.remark for each in unsound if each.is_final),
        OTHERS if not folders or is_part else LATER if any(each.is_final for each in unsound) else "",
        max([newest, *numbers]) if is_part or is_begun_later else None,
        newest,
    )


def missing_of(timeline: Timeline) -> MissingFiles:
    """Return what is missing of a timeline, by the indexes of everything that was given with it."""
    given = timeline.given
    indexes = given.indexes or {segment.path: segment for segment in timeline.segments}

    def index_of(path: Path) -> SegmentIndex:
        if path in given.unread:
            raise given.unread[path]
        return indexes[path]

    destroyed = [path for path, error in given.unread.items() if isinstance(error, NotMcapError)]
    own = {segment.path for segment in timeline.segments}
    chains = [
        each for each in group_by_chain(sorted([*indexes, *destroyed]), index_of) if not own.isdisjoint(each.paths)
    ]
    found = [_missing_of_chain(chain, timeline) for chain in chains]
    return found[0] if len(found) == 1 else reduce(_join, found, MissingFiles())


def describe_hidden(timeline: Timeline, selection: Selection = EVERYTHING) -> list[str]:
    """Return sentences about what was recorded in the time of a selection, and is not there: removed or destroyed."""
    found = missing_of(timeline)

    def is_inside(first: int, last: int) -> bool:
        times = [(segment_number(each.origin), each.from_ns, each.to_ns) for each in timeline.segments]
        before_ns = max((to_ns for number, _, to_ns in times if 0 < number < first), default=0)
        after_ns = min((from_ns for number, from_ns, _ in times if number > last), default=LATEST_NS)
        return selection.may_contain(before_ns, max(before_ns, after_ns))

    return replace(
        found,
        missing=tuple(each for each in found.missing if is_inside(each.first, each.last)),
        destroyed=tuple(
            file for file in found.destroyed if file.segment is None or is_inside(file.segment, file.segment)
        ),
    ).problems


def _missing_of_chain(chain: ChainFiles, timeline: Timeline) -> MissingFiles:
    given = timeline.given
    indexes = given.indexes or {segment.path: segment for segment in timeline.segments}
    files = [_by_index(indexes[path]) for path in chain.paths] + chain.destroyed
    files += [
        destroyed_file(path, error)
        for path, error in given.unread.items()
        if not isinstance(error, NotMcapError) and path.parent in chain.folders
    ]
    folders = [each for each in given.folders if each in chain.folders and chain.strange_in is None]
    placed = place_destroyed(files)
    with suppress(KeyFileError):
        return find_missing(placed, folders)
    return find_missing(placed)  # what is saved in the folders cannot be believed


def _by_index(index: SegmentIndex) -> FileVerification:
    """Return what a file says of itself; nothing of it is verified."""
    text = index.metadata.get(SIGNATURE, {}).get("statement", "")
    statement = parse_statement(text)
    is_copy = statement is None and not COPIES.keys().isdisjoint(index.metadata)
    claimed = None if is_copy else segment_number(index.origin) or None
    number = claimed if statement is None else statement.segment
    deletions = index.metadata.get(DELETIONS, {})
    return FileVerification(index.path, index.size_bytes, number, statement, text, deletions)


def _join(one: MissingFiles, other: MissingFiles) -> MissingFiles:
    """Return what is missing of two chains of one timeline."""
    return MissingFiles(
        (*one.missing, *other.missing),
        (*one.destroyed, *other.destroyed),
        one.deletions.including(other.deletions),
        (*one.states, *other.states),
        (*one.forged, *other.forged),
        (*one.unproven, *other.unproven),
        (*one.remarks, *other.remarks),
        one.untold or other.untold,
    )


def _not_given(missing: Sequence[MissingSegments], proven: int) -> Iterator[MissingSegments]:
    """Yield what is missing of an extract: of its beginning and end only what is `proven` to belong here was removed."""
    for each in missing:
        if each.reason != REMOVED or each.place == "middle" or (each.place == "end" and each.last <= proven):
            yield each
        elif each.place == "end" and each.first <= proven:
            yield replace(each, last=proven)
            yield replace(each, first=proven + 1, reason=NOT_GIVEN)
        else:
            yield replace(each, reason=NOT_GIVEN)


@dataclass(frozen=True, slots=True)
class _UnsoundState:
    """A folder in which nothing that can be believed tells the newest segment."""

    reason: str
    """It, or its file, and what is wrong with that."""
    last: int
    """The newest segment there."""
    is_final: bool
    """One of its files is signed as a whole, so that the gateway had saved something."""

    @property
    def why(self) -> str:
        """The reason as a clause, without the folder."""
        _, _, wrong = self.reason.partition(f"{STATE_NAME}: ")
        return f"{STATE_NAME} {wrong}" if wrong else f"the folder has no {STATE_NAME}"

    @property
    def remark(self) -> str:
        """What it leaves open, as a sentence."""
        return f"{self.reason}: whether segments after {self.last} were removed cannot be proved"


def _read_states(
    numbered: Sequence[FileVerification], folders: Sequence[Path]
) -> tuple[list[ChainState], list[_UnsoundState], list[str]]:
    """Return what the gateway has saved in the folders, where that proves nothing of the end, and what was forged."""
    states: list[ChainState] = []
    unsound: list[_UnsoundState] = []
    forged: list[str] = []
    for folder in folders:
        here = [file for file in numbered if file.path.parent == folder]
        signed = [file.statement for file in here if file.statement is not None and file.statement.public_key]
        try:
            state, reason = read_state(folder), f"{folder}: has no {STATE_NAME}"
        except ChainStateError as error:
            state, reason = None, str(error)
        if state is not None and signed and is_forged(state, signed, signed[-1].public_key):
            forged.append(f"FORGED: {folder / STATE_NAME} is not signed with the key of the recordings")
            state, reason = None, f"{folder / STATE_NAME}: is not signed"
        elif state is not None and signed and not state.signature:
            states.append(ChainState(deletions=state.deletions))  # by a version that signed the deletions in it alone
            state, reason = None, f"{folder / STATE_NAME}: is not signed"
        if state is not None:
            states.append(state)
        elif here:
            unsound.append(_UnsoundState(reason, here[-1].segment or 0, any(file.is_final for file in here)))
    return states, unsound, forged


def _join_deletions(
    stated: Sequence[FileVerification], states: Sequence[ChainState]
) -> tuple[DeletionStatement, list[str]]:
    """Return all that is stated about deletions, and what of it was forged.

    Of files without such statements, it is the largest number that they state.
    """
    statements = [file.statement for file in stated if file.statement is not None]
    key = statements[-1].public_key if statements else ""
    found = [found for file in stated if (found := parse_deletions(file.deletions)) is not None]
    forged: list[str] = []
    for state in states:
        if state.deletions and statements:
            if (statement := parse_deletions(state.deletions)) and has_signature(state.deletions, statement, key):
                found.append(statement)
            else:
                forged.append(
                    f"FORGED: what {STATE_NAME} says of deletions is not signed with the key of the recordings"
                )
    if found:
        return reduce(DeletionStatement.including, found), forged
    largest = max((statement.deleted_up_to for statement in statements), default=0)
    return DeletionStatement(gateway="", unstated_up_to=largest), forged
