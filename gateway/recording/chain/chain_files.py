"""The files of one chain among those that are given: of a gateway, of a key, or of the data folder of a gateway."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from devices.errors import RecordingError
from gateway.pki.signing_key import KEY_NAME
from gateway.recording.chain.chain_state import STATE_NAME, ChainStateError, list_aside, read_state
from gateway.recording.chain.file_verification import FileVerification
from gateway.recording.chain.statements import SIGNATURE, parse_deletions, parse_statement
from gateway.recording.format.salvage import NotMcapError
from gateway.recording.reading.recording_file import SegmentIndex, read_index
from gateway.recording.reading.timeline import list_recordings

MARKS = STATE_NAME, KEY_NAME, ".lock", "alerts", "calibration", "page-pin"
"""What stands beside the recordings in the data folder of a gateway and in its copy, and not beside an extract. Basis: what a
start of the gateway makes there."""


@dataclass(slots=True)
class ChainFiles:
    """Files of one chain."""

    paths: list[Path] = field(default_factory=list)
    """In the order in which they are given."""
    destroyed: list[FileVerification] = field(default_factory=list)
    """Those that are no MCAP files any more."""
    claims: set[str] = field(default_factory=set)
    """The gateways, keys and data folders that make them one chain."""
    strange_in: Path | None = None
    """The data folder of another gateway, in which they lie; None: they do not."""

    @property
    def folders(self) -> set[Path]:
        """The folders in which they lie."""
        return {path.parent for path in (*self.paths, *(file.path for file in self.destroyed))}


def is_data_folder(folder: Path) -> bool:
    """Return whether a folder is that of a gateway or its copy, in which all of its segments are expected."""
    return any((folder / name).exists() for name in MARKS) or bool(list_aside(folder))


def group_by_chain(paths: Sequence[Path], index_of: Callable[[Path], SegmentIndex] = read_index) -> list[ChainFiles]:
    """Return the files of each chain, in the order of their first files.

    What a file claims is not checked here: a false claim differs from what was signed in whichever chain it stands. Raises
    `RecordingError` where a file cannot be read, or none is an MCAP file.
    """
    chains: list[ChainFiles] = []
    in_data: dict[Path, list[ChainFiles]] = {}
    """The chains in each data folder, which is of the gateway that has written most of it."""
    silent: list[ChainFiles] = []
    problems: list[NotMcapError] = []
    for path in paths:
        try:
            claims = _claims(index_of(path))
        except NotMcapError as error:
            problems.append(error)
            silent.append(ChainFiles(destroyed=[destroyed_file(path, error)]))
            continue
        if claims:
            _join(
                in_data.setdefault(path.parent, []) if is_data_folder(path.parent) else chains,
                ChainFiles([path], [], claims),
            )
        else:
            silent.append(ChainFiles([path]))
    if len(problems) == len(paths):
        raise problems[0]
    for folder, inside in in_data.items():
        own, *strange = sorted(inside, key=lambda chain: -len(chain.paths))
        for each in strange:
            each.strange_in, each.claims = folder, {f"strange in {folder.resolve()}: {sorted(each.claims)}"}
        own.claims.add(str(folder.resolve()))
        for each in inside:
            _join(chains, each)
    for single in silent:
        beside = [chain for chain in chains if chain.folders & single.folders and chain.strange_in is None]
        single.claims = set(beside[0].claims) if len(beside) == 1 else {str(each) for each in single.folders}
        _join(chains, single)
    order = {path: number for number, path in enumerate(paths)}
    for chain in chains:
        chain.paths.sort(key=order.__getitem__)
    return sorted(
        chains, key=lambda chain: min(map(order.__getitem__, (*chain.paths, *(each.path for each in chain.destroyed))))
    )


def place_destroyed(files: Sequence[FileVerification]) -> list[FileVerification]:
    """Return the files, those that are destroyed with the number that is free beside their neighbours in the folder, by name.

    Where the folder tells that the gateway has recorded no segment of that number, the file is not a recording.
    """
    placed = list(files)
    ordered = sorted(range(len(placed)), key=lambda number: (placed[number].path.parent, placed[number].path.name))
    taken = {file.segment for file in placed}
    recorded = {folder: _recorded(folder) for folder in {file.path.parent for file in files if file.is_destroyed}}
    for order, step in ((ordered, 1), (ordered[::-1], -1)):
        for before, here in pairwise(order):
            file, number = placed[here], (placed[before].segment or 0) + step
            is_beside = placed[before].segment is not None and placed[before].path.parent == file.path.parent
            is_free = number > 0 and number not in taken
            if not (file.is_destroyed and file.segment is None and is_beside and is_free):
                continue
            is_recorded = recorded[file.path.parent]
            if is_recorded is None or is_recorded(number):
                placed[here] = replace(file, segment=number)
                taken.add(number)
    return [
        file
        if not file.is_destroyed or file.segment is not None or recorded[file.path.parent] is None
        else replace(file, is_destroyed=False, is_strange=True, problems=[])
        for file in placed
    ]


def _recorded(folder: Path) -> Callable[[int], bool] | None:
    """Return whether a segment of a number should be in a folder; None: the state of its chain is not there."""
    try:
        state = read_state(folder)
    except ChainStateError:
        return None
    if state is None:
        return None
    stated = parse_deletions(state.deletions)
    runs = () if stated is None else tuple(run for deletion in stated.deleted for run in deletion.segments)
    newest = state.newest_segment
    return lambda number: number <= newest and not any(first <= number <= last for first, last in runs)


def entire_folders(files: Sequence[FileVerification], folders: Sequence[Path]) -> set[Path]:
    """Return the folders of which every recording is given, as folders or by name."""
    given = {file.path.resolve() for file in files}
    named = {file.path.parent for file in files} - set(folders)
    return {*folders, *(each for each in named if {path.resolve() for path in list_recordings([each])} <= given)}


def _claims(index: SegmentIndex) -> set[str]:
    """Return the gateway and the key that the last statement in a file names."""
    statement = parse_statement(index.metadata.get(SIGNATURE, {}).get("statement", ""))
    return set() if statement is None else {f"gateway {statement.gateway}", f"key {statement.public_key}"} - {"key "}


def _join(chains: list[ChainFiles], new: ChainFiles) -> None:
    """Add files to the chain with which they have a claim in common; where there are several, these are one."""
    common = [chain for chain in chains if chain.claims & new.claims]
    if not common:
        chains.append(new)
        return
    for each in (*common[1:], new):
        common[0].paths += each.paths
        common[0].destroyed += each.destroyed
        common[0].claims |= each.claims
    chains[:] = [chain for chain in chains if chain not in common[1:]]


def destroyed_file(path: Path, error: RecordingError) -> FileVerification:
    """Return what is said of a file that is no MCAP file any more, or cannot be read for another reason."""
    reason = str(error).removeprefix(f"{path}: ").partition(";")[0]
    problem = f"DESTROYED: {reason}, and nothing of what was recorded is left in it"
    problems = [problem if isinstance(error, NotMcapError) else f"NOT READ: {reason}"]
    return FileVerification(path, path.stat().st_size, is_destroyed=True, problems=problems)
