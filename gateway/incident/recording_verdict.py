"""Whether the recordings of a report are what the gateway wrote, in the words of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gateway.pki.signing_key import KeyFileError, fingerprint
from gateway.recording.chain.chain_verification import ChainVerification, verify_chain
from gateway.recording.chain.file_verification import verify_file

VerdictKind = Literal["genuine", "differs", "open"]


@dataclass(frozen=True, slots=True)
class RecordVerdict:
    """The result of the verification."""

    kind: VerdictKind
    """`open`: nothing differs, and something that would prove it is missing."""
    label: str
    sentences: tuple[str, ...]


def judge_recordings(paths: Sequence[Path], key: str | None) -> RecordVerdict:
    """Verify the files of a report; `key`: the gateway's public key, None: not given.

    Files that are not given cannot be missed: only `record verify` of the whole folder states that none was removed. Raises
    `RecordingError` where a file cannot be read.
    """
    try:
        chain = verify_chain([verify_file(path, key) for path in paths], (), key)
    except KeyFileError as error:
        return RecordVerdict("open", "not verified", (f"{error}.",))
    if all(file.segment is None and file.statement is None for file in chain.files):
        return RecordVerdict(
            "open", "not signed", ("The recordings have no signatures: no change of them can be detected.",)
        )
    remarks = (*chain.remarks, *(f"{file.path.name}: {text}" for file in chain.files for text in file.remarks))
    if chain.answer == "differs":
        return RecordVerdict("differs", "THEY DIFFER FROM WHAT THE GATEWAY SIGNED", (*_problems(chain), *remarks))
    if not chain.public_keys:
        return RecordVerdict("open", "chained by hashes, not signed", remarks)
    signer = fingerprint(chain.public_keys[0])
    if key is None:
        compare = (
            f"Whoever wrote the recordings may have signed them: their key {signer} stands in them alone. "
            "Compare it with the gateway’s, or give that with --key."
        )
        return RecordVerdict("open", "consistent in themselves only", (compare, *remarks))
    return RecordVerdict("genuine", f"genuine, nothing differs from what the gateway signed (key {signer})", remarks)


def _problems(chain: ChainVerification) -> tuple[str, ...]:
    of_files = (f"{file.path.name}: {text}" for file in chain.files for text in file.problems)
    return (*chain.problems, *of_files)
