"""`plumbline record verify`: whether recordings are what the gateway wrote."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION
from gateway.cli.record.known_key import KEY_OPTION, KnownKey, key_of_recordings
from gateway.cli.recording_options import CA_OPTION, PATHS_OPTION
from gateway.errors import ANSWER_IS_NO, WITH_LOSSES

if TYPE_CHECKING:
    from gateway.messages import NewestStatement
    from gateway.recording.chain.chain_files import ChainFiles
    from gateway.recording.chain.chain_verification import ChainVerification
    from gateway.recording.chain.file_verification import FileVerification
    from gateway.recording.chain.time_stamps import ProvenTime

EXIT_CODES = {
    "genuine": 0,
    "differs": ANSWER_IS_NO,
    "consistent": WITH_LOSSES,
    "copy": WITH_LOSSES,
    "unsigned_end": WITH_LOSSES,
    "extract": WITH_LOSSES,
}
"""Definition: exit codes of the answers."""
BY_KEY = ("genuine", "unsigned_end", "extract")
"""Answers that hold by a key, which is named with them."""


@command(
    "verify",
    "check that recordings are what the gateway wrote: nothing changed, removed, exchanged or forged",
    "Check recordings against the signed statements in them: nothing changed, removed, exchanged, cut off or "
    "forged, and no clock set back by more than 30 s. Each gateway is judged by itself. Exit code 0: genuine by the key that is "
    "given, for which the site's CA vouches, or that `remote status` has heard at the first contact. Exit code 1: something "
    "differs, and each difference is named. Exit code 3: consistent in itself only, because no key is known, or nothing is "
    "signed; the end of a file is not signed, because it is being written or was cut off; a file is a cut, an export or a copy "
    "by this program, which nobody signs; or what is given is an extract, which cannot tell whether others were removed. A data "
    "folder or its copy is expected from the first segment on: those that the gateway has deleted, as it has signed, are named "
    "and are no difference. Named files, and recordings in a folder without anything else of a gateway, are an extract.",
    "example: plumbline record verify plumbline-data --key signing-key.pem.pub",
    PATHS_OPTION,
    KEY_OPTION,
    CA_OPTION,
    option(
        "--heard",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="health messages that somebody kept, as `remote status --json FILE` writes them: what they say of the newest "
        "segment must be there",
    ),
    option(
        "--tsa-ca",
        type=Path,
        metavar="FILE",
        help="certificates, in PEM, of the CA of the time stamp authority that the gateway asks: its time stamps are "
        "checked, "
        "and what they are about must be there",
    ),
    option(
        "--time-stamps",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="time stamps that were kept elsewhere, beside those in the folders: a copy of time-stamps.jsonl",
    ),
    JSON_OPTION,
)
def run_verify(arguments: argparse.Namespace) -> int:
    """Verify recordings; return the exit code of the worst answer."""
    from gateway.bus.known_gateways import read_statements
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.recording.chain.chain_files import group_by_chain
    from gateway.recording.chain.time_stamps import list_time_stamp_files, load_verifier, prove_all
    from gateway.recording.reading.timeline import list_recordings

    paths = list_recordings(arguments.paths)
    heard = [statement for path in arguments.heard for statement in read_statements(path)]
    folders = [path for path in arguments.paths if path.is_dir()]
    stamp_files = [*arguments.time_stamps, *(file for folder in folders for file in list_time_stamp_files(folder))]
    verifier = None if arguments.tsa_ca is None else load_verifier(arguments.tsa_ca)
    given = _Given(arguments.key, arguments.ca, folders, heard, *prove_all(stamp_files, verifier))
    judged: list[_JudgedChain] = []
    done = count(1)
    with ProgressBar("verifying") as bar:
        for files in group_by_chain(paths):
            judged.append(_judge(files, given, lambda: bar.update(next(done) / len(paths))))
    contents = [each.as_json() for each in judged]
    texts = [each.text() for each in judged]
    if len(judged) > 1:
        texts = [f"{each.name}:\n{text}" for each, text in zip(judged, texts, strict=True)]
    show("\n\n".join(texts), contents if len(contents) > 1 else contents[0], arguments.json)
    codes = {EXIT_CODES[each.chain.answer] for each in judged}
    return ANSWER_IS_NO if ANSWER_IS_NO in codes else max(codes)


@dataclass(frozen=True, slots=True)
class _Given:
    """What is given beside the recordings, of whichever gateway."""

    key: str | None
    ca: Path | None
    folders: Sequence[Path]
    heard: "Sequence[NewestStatement]"
    proven: "Sequence[ProvenTime]"
    stamp_remarks: Sequence[str]


def _judge(files: "ChainFiles", given: _Given, report: Callable[[], None]) -> "_JudgedChain":
    """Verify the files of one chain; `report` is called behind each."""
    from gateway.recording.chain.chain_verification import verify_chain
    from gateway.recording.chain.file_verification import verify_file

    known = key_of_recordings(given.key, given.ca, files.paths)
    found = list(files.destroyed)
    for path in files.paths:
        found.append(verify_file(path, known.public_key))
        report()
    heard = [*given.heard, *(each.statement for each in given.proven)]
    remembered = [] if known.heard is None or known.heard.public_key != known.public_key else [known.heard]
    folders = [folder for folder in given.folders if folder in files.folders and files.strange_in is None]
    chain = verify_chain(found, folders, known.public_key, heard, remembered)
    if files.strange_in is not None:
        strange = f"FOREIGN: another gateway has written most of {files.strange_in}, in which this lies"
        chain = replace(chain, problems=(strange, *chain.problems))
    if known.vouched is not None and known.vouched.refusal is not None:
        chain = replace(chain, problems=(*chain.problems, f"NOT VOUCHED FOR: {known.vouched.refusal}"))
    proven = [each for each in given.proven if each.statement.gateway in chain.gateways]
    return _JudgedChain(chain, known, proven, given.stamp_remarks)


@dataclass(frozen=True, slots=True)
class _JudgedChain:
    """What is said of the files of one chain."""

    chain: "ChainVerification"
    known: KnownKey
    proven: "Sequence[ProvenTime]"
    stamp_remarks: Sequence[str]

    @property
    def name(self) -> str:
        """The gateway."""
        return "; ".join(self.chain.gateways) or "no gateway has signed these"

    def as_json(self) -> dict[str, Any]:
        """Return the content of `--json`."""
        stamps = [{"segment": each.statement.segment, "time_utc": each.at.isoformat()} for each in self.proven]
        vouched = None if self.known.vouched is None else self.known.vouched.public_key
        content = {**self.chain.as_json(), "time_stamps": stamps, "time_stamp_remarks": list(self.stamp_remarks)}
        return {**content, "vouched_key": vouched}

    def text(self) -> str:
        """Return the lines for a person."""
        from gateway.pki.signing_key import fingerprint
        from gateway.recording.chain.time_stamps import describe_proven

        chain, key = self.chain, self.known.public_key
        lines = [line for file in chain.files for line in _file_lines(file)]
        if chain.segments:
            lines.append(f"the files are segments {chain.segments[0]} to {chain.segments[-1]}")
        said = (
            *describe_proven(self.proven),
            *self.stamp_remarks,
            *self._vouched(),
            *filter(None, [self.known.remark]),
        )
        lines += [f"  {text}" for text in (*chain.problems, *chain.remarks, *said)]
        if chain.extract_of is not None:
            lines.append(f"an extract: {_segments(chain)}; the others are not given, and nothing is said of them")
        if key is None and chain.public_keys:
            lines.append(f"key {fingerprint(chain.public_keys[0])} stands in the recordings themselves")
        by_key = f" ({self.known.phrase})" if chain.answer in BY_KEY else ""
        lines.append(f"{chain.conclusion}{by_key}")
        return "\n".join(lines)

    def _vouched(self) -> list[str]:
        """Return what the site's CA says, where it was asked and no problem says it."""
        from gateway.pki.signing_key import fingerprint

        vouched = self.known.vouched
        if vouched is None or vouched.refusal is not None:
            return []
        if vouched.public_key is None:
            return [
                "the site's CA does not vouch for the key that signed these: no segment has a voucher, as a gateway with a "
                "certificate of the site records it"
            ]
        return [f"the site's CA vouches for the key {fingerprint(vouched.public_key)} of {vouched.gateway}"]


def _segments(chain: "ChainVerification") -> str:
    first, last = chain.segments[0], chain.segments[-1]
    these = f"segment {first}" if first == last else f"segments {first} to {last}"
    return f"{these} of 1 to {chain.extract_of}" if chain.extract_of != last else f"{these}, and not those from 1 on"


def _file_lines(file: "FileVerification") -> list[str]:
    from gateway.recording.reading.interval import iso_utc

    statement = file.statement
    if file.is_strange:
        return [f"{file.path}: not a recording: no MCAP file, and none of the numbers of the chain is free for it"]
    if file.copy:
        return [f"{file.path}: {file.copy}", *(f"  {text}" for text in file.problems)]
    number = "no segment" if file.segment is None else f"segment {file.segment}"
    nothing = "not as it was signed" if file.is_altered else "nothing signed"
    signed = nothing if statement is None else f"signed up to {iso_utc(statement.to_ns)}"
    if file.is_final and not file.problems:
        signed = f"signed whole, up to {iso_utc(statement.to_ns) if statement else ''}"
    lines = [f"{file.path}: {number}, {signed}"]
    return lines + [f"  {text}" for text in (*file.problems, *file.remarks)]
