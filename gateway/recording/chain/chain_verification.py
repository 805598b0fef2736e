"""Offline verification of the segments of a gateway together: none removed, none exchanged, none with a clock set back.

The key may be given, or found by what the CA of the site says of it in the segments.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from gateway.bus.known_gateways import RefuseKey
from gateway.file_input import parse_json
from gateway.messages import NewestStatement
from gateway.pki.signing_key import fingerprint
from gateway.recording.chain.chain_files import place_destroyed
from gateway.recording.chain.chain_state import STATE_NAME, ChainState
from gateway.recording.chain.file_verification import WRONG_KEY, FileVerification
from gateway.recording.chain.missing_files import find_missing
from gateway.recording.chain.statements import SIGNATURE, MissingSegments, Statement, hash_of, parse_statement
from gateway.recording.reading.interval import iso_utc
from gateway.recording.reading.recording_file import read_index

Answer = Literal["genuine", "unsigned_end", "extract", "consistent", "copy", "differs"]
"""Everything is as the key signed that was given; what was signed is, and the end of a file was not; what is here is, and others
may be missing; everything is as the recordings say themselves, whoever wrote them; a file was made of recordings, and never
signed; something is not as it was signed."""
CONSISTENT = (
    "consistent in itself only: nothing differs from what was signed, but whoever wrote the files may have signed them; "
    "give the gateway's public key with --key"
)
OTHER_KEY = "either it is not that of this gateway, or another one wrote these"
LATEST_NS = 30_000_000_000
"""Samples may be recorded so much later than messages about the gateway itself, so that neighbouring segments overlap. Basis: on
a busy host samples wait up to 25 s to be processed (`parts.MAX_WAITING_BLOCKS`), and a wireless sensor is some seconds late."""


@dataclass(frozen=True, slots=True)
class ChainVerification:
    """What was found in files of one gateway."""

    files: tuple[FileVerification, ...]
    """In the order of their numbers; those without one at the end."""
    missing: tuple[MissingSegments, ...]
    """Numbers without a file, in their order. Where files were named, those before and after them are not missed."""
    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    public_keys: tuple[str, ...]
    is_key_known: bool
    """The key of the gateway was given from outside the recordings."""
    gateways: tuple[str, ...] = ()
    """Those that have signed the files; more than one where a gateway got another name."""
    extract_of: int | None = None
    """The files are a part of the segments 1 to this one at least; None: nothing says that there are others."""
    untold: str = ""
    """What cannot be told of others, where files were named, or the folder lacks some, or what would tell the newest; empty: none
    was removed."""
    unproven: tuple[str, ...] = ()
    """Why it cannot be told of a folder whether later ones were removed."""

    @property
    def answer(self) -> Answer:
        """The answer in a word."""
        if self.problems or any(file.problems for file in self.files):
            return "differs"
        if self._copies:
            return "copy"
        return self._answer_of_signed

    @property
    def _answer_of_signed(self) -> Answer:
        if not (self.is_key_known and self.public_keys):
            return "consistent"
        if self.signed_up_to:
            return "unsigned_end"
        return "extract" if self.untold else "genuine"

    @property
    def signed_up_to(self) -> str:
        """Up to when the files are signed, and what at their ends is not, as a clause; empty: they are signed as a whole."""
        stated = [(file.statement.to_ns, file.open_end) for file in self.files if file.statement and file.open_end]
        if not stated:
            return ""
        return f"up to {iso_utc(min(to_ns for to_ns, _ in stated))}; {'; '.join(end for _, end in stated)}"

    @property
    def is_of_other_key(self) -> bool:
        """One key has signed everything as it is, and not the one that was given."""
        found = [*self.problems, *(text for file in self.files for text in file.problems)]
        return bool(found) and len(self.public_keys) == 1 and all(text.startswith(WRONG_KEY) for text in found)

    @property
    def _copies(self) -> list[FileVerification]:
        return [file for file in self.files if file.copy]

    @property
    def conclusion(self) -> str:
        """The answer as a sentence."""
        if self.answer == "differs":
            return (
                f"NOT genuine by the key that was given: {OTHER_KEY}"
                if self.is_of_other_key
                else "NOT genuine: see above"
            )
        said = [
            f"{file.path.name}: {file.copy}, not signed by the gateway: compare it with the originals"
            for file in self._copies
        ]
        if len(said) < sum(not file.is_strange for file in self.files):
            said.append(self._conclusion_of_signed)
        return "\n".join(said) or "no recording is among these"

    @property
    def _conclusion_of_signed(self) -> str:
        match self._answer_of_signed:
            case "genuine":
                return "genuine: everything is as the gateway's key signed"
            case "extract":
                return f"genuine as far as it goes: everything here is as the gateway's key signed; {self.untold}"
            case "unsigned_end":
                return f"genuine {self.signed_up_to}{self.untold and f'; {self.untold}'}"
            case _:
                return f"{CONSISTENT}{self.signed_up_to and f'; signed {self.signed_up_to}'}"

    @property
    def segments(self) -> list[int]:
        """The numbers of the files, in their order."""
        return [file.segment for file in self.files if file.segment is not None]

    def as_json(self) -> dict[str, Any]:
        """Return the content of `record verify --json`."""
        return {
            "answer": self.answer,
            "genuine": self.answer == "genuine",
            "problems": list(self.problems),
            "remarks": list(self.remarks),
            "gateways": list(self.gateways),
            "public_keys": list(self.public_keys),
            "extract_of": self.extract_of,
            "first_segment": self.segments[0] if self.segments else None,
            "last_segment": self.segments[-1] if self.segments else None,
            "missing": [asdict(each) for each in self.missing],
            "files": [_file_json(file) for file in self.files],
        }


def verify_chain(
    files: Sequence[FileVerification],
    folders: Sequence[Path] = (),
    key: str | None = None,
    heard: Sequence[NewestStatement] = (),
    remembered: Sequence[NewestStatement] = (),
    ends_in: Path | None = None,
) -> ChainVerification:
    """Compare the statements of files with each other; `folders` are given as a whole, from the first to the newest segment.

    `ends_in`: a folder that is given from some segment on to the newest.

    `key` is the one with which the files were verified. `heard` is what somebody gives of the gateway's statements, and must be
    here; what this user has `remembered` need not be in an extract. A folder without anything else of a gateway is an extract.
    """
    files = place_destroyed(files)
    numbered = sorted((file for file in files if file.segment is not None), key=lambda file: file.segment or 0)
    others = [file for file in files if file.segment is None]
    stated = [(file, file.statement) for file in numbered if file.statement is not None]
    problems: list[str] = []
    remarks: list[str] = []
    keys = tuple(dict.fromkeys(statement.public_key for _, statement in stated if statement.public_key))
    if len(keys) > 1:
        problems.append(f"WRONG KEY: {len(keys)} keys have signed: {', '.join(map(fingerprint, keys))}")
    problems += _exchanged(numbered)
    remarks += _copied(numbered)
    for (before, first), (after, second) in pairwise(stated):
        problems += _between(before, first, after, second)
    named = tuple(dict.fromkeys(statement.gateway for _, statement in stated))
    heard, remembered = ([each for each in given if each.gateway in named] for given in (heard, remembered))
    found = find_missing(
        files, folders, [each.segment for each in heard], [each.segment for each in remembered], ends_in
    )
    problems += found.forged
    problems += _not_whole(numbered, found.states, [*heard, *remembered])
    remarks += found.remarks
    last = max((file.segment or 0 for file in numbered), default=0)
    for number in sorted({statement.rebuilt_before for _, statement in stated} - {0}):
        remarks.append(
            f"before segment {number} the gateway had lost {STATE_NAME} and went on from its recordings: "
            "whether later ones had been there, and what the quota had just deleted, cannot be proved"
        )
    is_repaired = any(file.segment == last and statement.repaired for file, statement in stated)
    if is_repaired and found.may_go_on(last):
        remarks.append(
            f"segment {last} was completed at a later start of the gateway: what it recorded from then on is not in these files"
        )
    return ChainVerification(
        (*numbered, *others),
        found.missing,
        (*problems, *found.removed),
        (*found.deleted, *remarks),
        keys,
        key is not None,
        named,
        found.extract_of,
        found.untold,
        found.unproven,
    )


def _exchanged(numbered: Sequence[FileVerification]) -> list[str]:
    """Return a problem for each pair of different files with one number, and for each file with the name of another segment."""
    problems = []
    segments = {file.statement.name: file.segment for file in numbered if file.statement is not None}
    for file in numbered:
        named = segments.get(file.path.name, file.segment)
        if named != file.segment:
            problems.append(f"EXCHANGED: {file.path.name} is segment {file.segment}, with the name of segment {named}")
    for before, after in pairwise(numbered):
        if before.segment == after.segment and not _are_same(before, after):
            problems.append(f"COPIED: {before.path.name} and {after.path.name} are both segment {after.segment}")
    return problems


def _copied(numbered: Sequence[FileVerification]) -> list[str]:
    """Return a remark for each file that is there twice, with one content."""
    return [
        f"{before.path.name} and {after.path.name} are the same segment {after.segment} twice"
        for before, after in pairwise(numbered)
        if _are_same(before, after)
    ]


def _are_same(one: FileVerification, other: FileVerification) -> bool:
    is_whole = all(file.is_final and not file.problems for file in (one, other))
    return is_whole and one.statement_text == other.statement_text


def _between(before: FileVerification, first: Statement, after: FileVerification, second: Statement) -> list[str]:
    """Return what is wrong between two neighbours."""
    problems = []
    if second.gateway != first.gateway:
        problems.append(f"{after.path.name}: is of {second.gateway}, {before.path.name} of {first.gateway}")
    if second.from_ns < first.to_ns - LATEST_NS and after.segment != before.segment:
        back_s = (first.to_ns - second.from_ns) / 1e9
        problems.append(
            f"CLOCK SET BACK by {back_s:.3f} s: {after.path.name} begins at {iso_utc(second.from_ns)}, "
            f"{before.path.name} ended at {iso_utc(first.to_ns)}"
        )
    return problems


@dataclass(frozen=True, slots=True)
class _Whole:
    """What somebody states of the whole of a segment."""

    segment: int
    sha256: str
    """Hash of its final statement."""
    stated_by: str
    heard: str = ""
    """How it is known beside the files, as a clause; empty: a later file follows it."""

    def describe(self, file: FileVerification) -> str:
        """Return what is wrong with a file that is not whole, or has another final statement."""
        name = file.path.name
        if not file.is_final:
            return f"CUT: {name} is not whole: {self.stated_by} states that it was signed as a whole"
        if self.heard:
            return f"REWRITTEN: {name} has another statement than the one of segment {self.segment} that {self.heard}"
        return f"EXCHANGED: {self.stated_by} does not follow this {name}, but another one"


def _not_whole(
    numbered: Sequence[FileVerification], states: Iterable[ChainState], heard: Iterable[NewestStatement]
) -> list[str]:
    """Return the segments that do not end as later ones, the saved state or who listened to the gateway state, byte for byte."""
    stated = [
        _Whole(after.statement.previous_segment, after.statement.previous_sha256, after.path.name)
        for after in numbered
        if after.statement is not None
    ]
    stated += [_Whole(each.final_segment, each.final_sha256, STATE_NAME, f"{STATE_NAME} has") for each in states]
    was_heard = "was heard from the gateway when it was signed"
    stated += [_Whole(each.segment, each.sha256, "who listened to the gateway", was_heard) for each in heard]
    by_number = {file.segment: file for file in numbered}
    wrong: dict[Path, str] = {}
    for whole in stated:
        if (file := by_number.get(whole.segment)) is None or file.is_destroyed or (file.problems and file.has_end):
            continue  # missing, or said already, and nothing is cut off
        statement = file.statement if file.is_final else None
        if statement is None or whole.sha256 not in (hash_of(file.statement_text), statement.replaces_sha256):
            wrong.setdefault(file.path, whole.describe(file))
    not_signed = [
        f"NOT SIGNED: {before.unsigned_bytes} bytes at the end of {before.path.name} are not signed, "
        f"though segment {after.segment} follows; the gateway signs them when it repairs the file"
        for before, after in pairwise(numbered)
        if before.unsigned_bytes and before.path not in wrong
    ]
    return [*wrong.values(), *not_signed]


def _file_json(file: FileVerification) -> dict[str, Any]:
    statement = file.statement
    return {
        "path": str(file.path),
        "segment": file.segment,
        "kind": None if statement is None else statement.kind,
        "signed_bytes": 0 if statement is None else statement.bytes,
        "size_bytes": file.size_bytes,
        "signed_up_to_ns": None if statement is None else statement.to_ns,
        "unsigned_bytes": file.unsigned_bytes,
        "unsigned_up_to_ns": file.unsigned_to_ns if file.unsigned_bytes and file.unsigned_to_ns else None,
        "is_recording": not file.is_strange,
        "problems": file.problems,
        "remarks": file.remarks,
    }


@dataclass(frozen=True, slots=True)
class VouchedKey:
    """What the CA says of recordings."""

    gateway: str = ""
    public_key: str | None = None
    """None: it does not vouch for any key in them."""
    refusal: str | None = None
    """Why it does not; None also where it was not asked: no segment has a voucher."""


def find_vouched_key(paths: Sequence[Path], refuse: RefuseKey) -> VouchedKey:
    """Return the newest key in recordings for which a CA vouches; `paths` are in order of time.

    Whether the recordings are signed with it is not looked at. Raises `RecordingError` for a file that cannot be read.
    """
    refused = VouchedKey()
    for path in reversed(paths):
        index = read_index(path)
        statement = parse_statement(index.metadata.get(SIGNATURE, {}).get("statement", ""))
        if statement is None or not index.voucher:
            continue
        try:
            why = refuse(statement.gateway, statement.public_key, parse_json(index.voucher))
        except ValueError:
            why = "its voucher cannot be read"
        if why is None:
            return VouchedKey(statement.gateway, statement.public_key)
        refused = VouchedKey(refusal=refused.refusal or f"{path.name}: {why}")
    return refused
