"""Time stamps of an authority outside (RFC 3161) on a gateway's newest statement: they prove to others by when it existed.

What is stamped is the hash of the final statement as 64 hexadecimal digits in ASCII, so that `openssl ts -verify` checks a
response too. The package `rfc3161-client` is an extra.
"""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from gateway.errors import InputError, PlumblineError
from gateway.extras import what_is_missing
from gateway.file_input import decode_json, read_bounded, reason_of
from gateway.messages import NewestStatement

if TYPE_CHECKING:
    from rfc3161_client import TimeStampRequest, TimeStampResponse, Verifier

NAME = "time-stamps.jsonl"
"""The file in the data folder; its predecessor ends with `.previous.jsonl`."""
MAX_RESPONSE_BYTES = 65_536
"""Largest response of an authority. Basis: a choice; ten times one with the certificates of its chain."""


class TimeStampError(PlumblineError):
    """A time stamp cannot be made, or proves nothing; the text says why in one line."""


@dataclass(frozen=True, slots=True)
class StoredTimeStamp:
    """A line of the file."""

    statement: NewestStatement
    response: str
    """The authority's response in DER, by Base64."""


@dataclass(frozen=True, slots=True)
class ProvenTime:
    """What a valid time stamp proves: the statement, and all before it, existed at this time."""

    statement: NewestStatement
    at: datetime
    """By the clock of the authority."""


def _require_library() -> None:
    if (missing := what_is_missing("timestamp")) is not None:
        raise TimeStampError(missing)


def make_request(statement: NewestStatement) -> "TimeStampRequest":
    """Return the request for a time stamp, with a random number. Raises `TimeStampError` without the extra `timestamp`."""
    _require_library()
    from rfc3161_client import HashAlgorithm, TimestampRequestBuilder  # noqa: PLC0415  (an extra)

    return TimestampRequestBuilder().data(_stamped(statement)).hash_algorithm(HashAlgorithm.SHA256).build()


def take_response(request: "TimeStampRequest", statement: NewestStatement, content: bytes) -> bytes:
    """Return the line to be stored of a response that is granted, and the answer to this request; raise `TimeStampError` else."""
    response = _decode(content)
    if response.status != 0:
        raise TimeStampError(
            f"the time stamp authority refuses: {', '.join(response.status_string) or response.status}"
        )
    info = response.tst_info
    if info.nonce != request.nonce or info.message_imprint.message != request.message_imprint.message:
        raise TimeStampError("the time stamp authority has answered another request")
    return msgspec.json.encode(StoredTimeStamp(statement, base64.b64encode(content).decode()))


def read_time_stamps(path: Path) -> tuple[list[StoredTimeStamp], int]:
    """Return the time stamps of a file, and the number of lines that are none. Raises `InputError`."""
    try:
        lines = read_bounded(path).splitlines()
    except OSError as error:
        raise InputError(f"{path}: {reason_of(error).lower()}; check the path") from error
    found = [stamp for line in lines if (stamp := _parse(line)) is not None]
    return found, len(lines) - len(found)


def load_verifier(path: Path) -> "Verifier":
    """Return the verifier by the certificates of an authority's CA, in PEM. Raises `InputError`, and `TimeStampError`."""
    _require_library()
    from cryptography.x509 import load_pem_x509_certificates  # noqa: PLC0415  (an extra)
    from rfc3161_client import VerifierBuilder  # noqa: PLC0415  (an extra)

    try:
        certificates = load_pem_x509_certificates(read_bounded(path))
        roots = [each for each in certificates if each.issuer == each.subject]
        others = [each for each in certificates if each not in roots]
        return VerifierBuilder(roots=roots, intermediates=others).build()
    except OSError as error:
        raise InputError(f"--tsa-ca {path}: {reason_of(error).lower()}; check the path") from error
    except ValueError as error:
        raise InputError(f"--tsa-ca {path}: has no certificate of a CA; give one in PEM") from error


def prove(stamp: StoredTimeStamp, verifier: "Verifier") -> ProvenTime:
    """Return what a time stamp proves. Raises `TimeStampError` where it is not of this authority, or of another statement."""
    from rfc3161_client import VerificationError  # noqa: PLC0415  (there is a verifier)

    response = _decode(base64.b64decode(stamp.response))
    try:
        verifier.verify_message(response, _stamped(stamp.statement))
    except (VerificationError, ValueError) as error:
        raise TimeStampError(f"the time stamp of segment {stamp.statement.segment} proves nothing: {error}") from error
    at = response.tst_info.gen_time
    return ProvenTime(stamp.statement, at.replace(tzinfo=at.tzinfo or UTC).astimezone(UTC))


def list_time_stamp_files(folder: Path) -> list[Path]:
    """Return the files of time stamps in a data folder."""
    path = folder / NAME
    return [each for each in (path.with_suffix(".previous.jsonl"), path) if each.is_file()]


def prove_all(paths: Sequence[Path], verifier: "Verifier | None") -> tuple[list[ProvenTime], list[str]]:
    """Return what files of time stamps prove, and remarks on what proves nothing; `verifier`: None: no authority is known."""
    proven, remarks = [], []
    for path in paths:
        stamps, others = read_time_stamps(path)
        wrong = [""] * others
        for stamp in stamps:
            try:
                if verifier is not None:
                    proven.append(prove(stamp, verifier))
            except TimeStampError as error:
                wrong.append(f": {error}")
        if wrong:
            remarks.append(f"{path}: {len(wrong)} of {others + len(stamps)} time stamps are not valid{max(wrong)}")
        if stamps and verifier is None:
            remarks.append(
                f"{path}: {len(stamps)} time stamps are not checked; give the certificate of their authority's CA with --tsa-ca"
            )
    return proven, remarks


def describe_proven(proven: Sequence[ProvenTime]) -> list[str]:
    """Return a line for the first and the last segment whose time is proven."""
    earliest: dict[int, ProvenTime] = {}
    for each in sorted(proven, key=lambda each: each.at):
        earliest.setdefault(each.statement.segment, each)
    ends = [earliest[number] for number in dict.fromkeys((min(earliest), max(earliest)))] if earliest else []
    return [
        f"segment {each.statement.segment}, and all before it, existed on {each.at:%Y-%m-%dT%H:%M:%SZ}, by a time stamp of the "
        "authority outside"
        for each in ends
    ]


def _stamped(statement: NewestStatement) -> bytes:
    return statement.sha256.encode()


def _decode(content: bytes) -> "TimeStampResponse":
    _require_library()
    from rfc3161_client import decode_timestamp_response  # noqa: PLC0415  (an extra)

    try:
        return decode_timestamp_response(content)
    except ValueError as error:
        raise TimeStampError(f"is no response of a time stamp authority ({error})") from error


def _parse(line: bytes) -> StoredTimeStamp | None:
    try:
        stamp = decode_json(line, StoredTimeStamp)
        base64.b64decode(stamp.response, validate=True)
    except ValueError:
        return None
    return stamp
