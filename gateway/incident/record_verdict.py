"""Whether the recordings of a report are what the gateway wrote: the verification of its files, in words."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from gateway.errors import counted, first_of
from gateway.pki.signing_key import KeyFileError, fingerprint
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file
from gateway.recording.chain.missing_files import MissingFiles
from gateway.recording.chain.statements import REMOVED, name_missing

GENUINE = "genuine, "
NOTHING_MISSING = MissingFiles()
VerdictKind = Literal["genuine", "differs", "open"]


@dataclass(frozen=True, slots=True)
class AlterableEnd:
    """The end of a file that its gateway did not sign while it ran."""

    from_ns: int
    to_ns: int
    """Gateway times of the last signature before it, and of its last message."""
    words: str
    """What became of it, after its length."""


@dataclass(frozen=True, slots=True)
class RecordVerdict:
    """The result of the verification."""

    kind: VerdictKind
    """`open`: nothing differs, and something that would prove it is missing."""
    label: str
    sentences: tuple[str, ...]
    scope: str = ""
    """Which files were checked, as a sentence."""
    problems: tuple[str, ...] = ()
    """Those of the sentences that say what differs."""
    alarm: str = ""
    """What differs, in some words above everything else; empty: nothing does."""
    first: int = 1
    """Number of the first file."""
    is_from_first: bool = False
    """There are no earlier files, or they would have been missed."""
    is_to_newest: bool = False
    """Later files would have been missed."""
    lost: tuple[str, ...] = ()
    """Which segments are missing or destroyed among these files, or behind them, each as a clause."""
    untold: str = ""
    """Why it cannot be told whether later ones are missing, as a clause; empty: it can, or was not looked at."""
    alterable: tuple[AlterableEnd, ...] = ()

    @property
    def line(self) -> str:
        """The verdict in one line."""
        return " ".join(filter(None, (f"Recordings: {self.label}.", self.scope)))


def scope_text(checked: int, given: int, verdict: RecordVerdict) -> str:
    """Return which of the files that were given, and can be read, were checked, as a sentence."""
    lost = "".join(f"; {each}" for each in verdict.lost)
    if checked != given:
        rest = given - checked
        report = f"the {counted(checked, 'file')} that this report is made from{lost}"
        return f"Checked: {report}; the other {rest} {'was' if rest == 1 else 'were'} not."
    files = f"{counted(checked, 'file')}, all that were given{' and can be read' if verdict.lost else ''}"
    if verdict.is_from_first and verdict.is_to_newest:
        first = (
            "the gateway’s first one"
            if verdict.first == 1
            else f"segment {verdict.first}, the first one that the gateway has left,"
        )
        return f"Checked: {files}{lost or f', from {first} to its newest'}."
    others = {(True, False): "later ones", (False, True): "earlier ones"}
    which = others.get((verdict.is_from_first, verdict.is_to_newest), "others")
    why = f" cannot be told ({verdict.untold})" if verdict.untold else " was not"
    return f"Checked: {files}{lost}; whether {which} are missing{why}."


def judge_recordings(
    paths: Sequence[Path],
    key: str | None,
    *,
    said_by: str = "",
    refusal: str | None = None,
    ends_in: Path | None = None,
    folders: Sequence[Path] = (),
    is_extract: bool = False,
    beside: MissingFiles = NOTHING_MISSING,
    elsewhere: Sequence[str] = (),
) -> RecordVerdict:
    """Verify the files of a report.

    `is_extract`: what was given is not a whole data folder, so that files may have been removed from it unnoticed;
    `key`: the gateway's public key, None: not known; `said_by`: the key and who says that it is the gateway's, as a sentence;
    `refusal`: why the site's CA does not vouch for it, None: it does, or was not asked. Files that are not given cannot be
    missed, but those behind the last one where its folder is given, which `ends_in` names, and any of `folders` where all of
    their files are used; `beside`: what is removed or destroyed next to the files, `elsewhere`: sentences about what is anywhere.
    Raises `RecordingError` where a file cannot be read.
    """
    try:
        files = [verify_file(path, key) for path in paths]
        files += beside.destroyed
        chain = _with_removed(verify_chain(files, folders, key, ends_in=ends_in), beside)
    except KeyFileError as error:
        return RecordVerdict("open", "not verified", (f"{error}.",))
    verdict = _judge(chain, key, said_by, refusal)
    if (is_extract or elsewhere) and verdict.kind == "genuine":
        others = f"; of the other files: {first_of(elsewhere, 1)}" if elsewhere else ""
        verdict = replace(verdict, kind="open", label=f"{verdict.label.removeprefix(GENUINE)}{others}")
    return replace(
        verdict,
        first=(chain.segments or [0])[0],
        is_from_first=bool(folders) or chain.segments[:1] == [1],
        is_to_newest=ends_in is not None and not chain.unproven,
        lost=tuple(_lost(chain)),
        untold=", and ".join(chain.unproven),
        alterable=tuple(_alterable_ends(chain)),
    )


def _with_removed(chain: ChainVerification, beside: MissingFiles) -> ChainVerification:
    """Return the chain with what is missing beside its files, where it is not found of them alone."""
    known = {(each.first, each.last) for each in chain.missing if each.reason == REMOVED}
    others = tuple(each for each in beside.missing if (each.first, each.last) not in known)
    problems = (*chain.problems, *replace(beside, missing=others).removed)
    return replace(chain, missing=(*chain.missing, *others), problems=problems)


def _lost(chain: ChainVerification) -> Iterator[str]:
    if removed := [each for each in chain.missing if each.reason == REMOVED]:
        yield f"{name_missing(removed)} missing"
    for file in chain.files:
        if file.is_destroyed:
            number = "" if file.segment is None else f", segment {file.segment},"
            yield f"{file.path.name}{number} is destroyed"


def _alterable_ends(chain: ChainVerification) -> Iterator[AlterableEnd]:
    for file in chain.files:
        if file.statement is None:
            continue
        if file.open_end:
            yield AlterableEnd(
                file.statement.to_ns, file.unsigned_to_ns, f"at the end of {file.path.name} that are not signed"
            )
        elif file.statement.repaired_from_ns:
            words = "before the end of a run that were signed at the next start alone"
            yield AlterableEnd(file.statement.repaired_from_ns, file.statement.to_ns, words)


def _judge(chain: ChainVerification, key: str | None, said_by: str, refusal: str | None) -> RecordVerdict:
    if all(file.segment is None and file.statement is None for file in chain.files):
        return RecordVerdict(
            "open", "not signed", ("The recordings have no signatures: no change of them can be detected.",)
        )
    remarks = (*chain.remarks, *(f"{file.path.name}: {text}" for file in chain.files for text in file.remarks))
    if chain.answer == "differs" or refusal is not None:
        found = _problems(chain)
        if chain.is_of_other_key:
            label, alarm = "SIGNED BY ANOTHER KEY THAN THE ONE GIVEN", "Recordings signed by another key"
            remarks = (
                "Either the key that was given is not that of this gateway, or another one wrote them.",
                *remarks,
            )
        elif found:
            label, alarm = "THEY DIFFER FROM WHAT THE GATEWAY SIGNED", "Recordings altered, damaged or incomplete"
        else:
            label, alarm = "THE SITE’S CA DOES NOT VOUCH FOR THEM", "Recordings without a voucher"
        problems = (*found, *([refusal] if refusal else []))
        sentences = (*problems, *filter(None, [said_by]), *remarks)
        return RecordVerdict("differs", label, sentences, problems=problems, alarm=alarm)
    if not chain.public_keys:
        return RecordVerdict("open", "chained by hashes, not signed", remarks)
    signer = fingerprint(chain.public_keys[0])
    if key is None:
        compare = (
            f"Whoever wrote the recordings may have signed them: their key {signer} stands in them alone. "
            "Compare it with the gateway’s, or give that with --key, or the site’s CA with --ca."
        )
        return RecordVerdict("open", "consistent in themselves only", (compare, *remarks))
    sentences = (said_by, *remarks) if said_by else remarks
    kind: VerdictKind
    label = f"nothing differs from what the gateway signed (key {signer})"
    if chain.answer in ("genuine", "extract"):
        kind, label = "genuine", f"{GENUINE}{label}"
    else:
        kind, label = "open", f"{label} {chain.signed_up_to or 'of those that are signed; copies are among them'}"
    return RecordVerdict(kind, label, sentences)


def _problems(chain: ChainVerification) -> tuple[str, ...]:
    of_files = (f"{file.path.name}: {text}" for file in chain.files for text in file.problems)
    return (*chain.problems, *of_files)
