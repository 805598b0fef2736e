"""The door of an archive: what a file claims to be, and whether its signatures say so."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from devices.errors import RecordingError
from gateway.archive.rows import Trust
from gateway.archive.segment_rows import SegmentRows, read_rows
from gateway.bus.known_gateways import RefuseKey, known_statement
from gateway.bus.untrusted import GATEWAY_KEY
from gateway.errors import InputError
from gateway.fleet.selection import KEY_PREFIX, read_expected
from gateway.pki.signing_key import read_public_key
from gateway.recording.chain.chain_verification import VouchedKey, find_vouched_key
from gateway.recording.chain.file_verification import FileVerification, verify_file
from gateway.recording.chain.statements import SIGNATURE, hash_of, parse_statement
from gateway.recording.format.content import ORIGIN
from gateway.recording.reading.recording_file import read_index
from gateway.recording.reading.timeline import GATEWAY_KEYS

MAX_TIME_NS = 2**62
"""Latest time of a recording. Definition: the year 2116, far from where dates and sums overflow."""
MAX_SPAN_NS = 2 * 86_400_000_000_000
"""Longest recording. Basis: a choice; 48 times the longest segment that can be configured (an hour)."""
NOT_WHOLE = ("NOT SIGNED", "CUT:")
"""How problems begin that only say that a signature is missing; every other one says that something was changed."""

KeyOf = Callable[[str], str | None]
"""Takes `<site>/<crane>/<sensor>`; returns the gateway's public key, None: not known."""


@dataclass(frozen=True, slots=True)
class Admission:
    """What a file is, as far as it can be believed."""

    sha256: str
    gateway: tuple[str, str, str] | None
    """Site, crane and sensor; None where they are not to be believed."""
    trust: Trust
    reason: str
    boot_id: str = ""
    software: str = ""
    segment: int | None = None
    public_key: str = ""
    given_key: str = ""
    asked_ca: str = ""
    statement_sha256: str = ""
    previous_sha256: str = ""
    is_final: bool = False
    is_trimmed: bool = False
    rows: SegmentRows | None = None
    """None: it is refused."""


@dataclass(frozen=True, slots=True)
class Authority:
    """The CA of a site, which is asked for the keys of gateways that are not known otherwise."""

    refuse: RefuseKey
    sha256: str
    """Of its certificates."""


def known_key(gateway: str) -> str | None:
    """Return the key that this user has heard of a gateway at the first contact."""
    known = known_statement(KEY_PREFIX + gateway)
    return None if known is None else known.public_key


def read_keys(path: Path) -> KeyOf:
    """Return the keys of a file with lines `<site>/<crane>/<sensor> <public key>`. Raises `InputError` and `KeyFileError`."""
    keys = {gateway.removeprefix(KEY_PREFIX): read_public_key(key) for gateway, key in read_expected(path).items()}
    return lambda gateway: keys.get(gateway) or known_key(gateway)


class RefusedFileError(InputError):
    """A file is not taken; the text is the reason."""

    def __init__(self, reason: str, given_key: str = "") -> None:
        super().__init__(reason)
        self.given_key = given_key


def admit(path: Path, key_of: KeyOf, authority: Authority | None = None) -> Admission:
    """Verify a file and read its rows; a file that cannot be taken is refused with the reason."""
    sha256 = ""
    try:
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        return _admit(path, sha256, key_of, authority)
    except OSError as error:
        return Admission(sha256, None, "refused", f"cannot be read: {error.strerror or error}")
    except RecordingError as error:
        return Admission(sha256, None, "refused", f"damaged: {str(error).removeprefix(f'{path}: ')}")
    except RefusedFileError as error:
        return Admission(sha256, None, "refused", str(error), given_key=error.given_key)


def _admit(path: Path, sha256: str, key_of: KeyOf, authority: Authority | None) -> Admission:
    metadata = read_index(path).metadata
    origin = metadata.get(ORIGIN, {})
    stated = parse_statement(metadata.get(SIGNATURE, {}).get("statement", ""))  # its signature is checked below
    name = _gateway(origin, None if stated is None else stated.gateway)
    key, asked, vouched = key_of(name) or "", "", VouchedKey()
    if not key and authority is not None:
        asked, vouched = authority.sha256, find_vouched_key([path], authority.refuse)
        key = vouched.public_key or ""
    found = verify_file(path, key or None)
    statement = found.statement
    not_vouched = () if vouched.refusal is None else (f"NOT VOUCHED FOR: {vouched.refusal}",)
    trust, reason = _trust(found, key), "; ".join((*found.problems, *not_vouched, *found.remarks))
    if trust == "refused":
        raise RefusedFileError(reason, key)
    _gateway(origin, None if statement is None else statement.gateway)
    rows = read_rows(path)
    _check_times(rows)
    site, crane, sensor = name.split("/")
    return Admission(
        sha256,
        (site, crane, sensor),
        trust,
        reason,
        boot_id=origin.get("boot_id", ""),
        software=origin.get("software", ""),
        segment=found.segment,
        public_key="" if statement is None else statement.public_key,
        given_key=key,
        asked_ca=asked,
        statement_sha256=hash_of(found.statement_text) if found.statement_text else "",
        previous_sha256="" if statement is None else statement.previous_sha256,
        is_final=found.is_final,
        is_trimmed=statement is not None and bool(statement.replaces_sha256),
        rows=rows,
    )


def _gateway(origin: Mapping[str, str], signed_for: str | None) -> str:
    """Return site, crane and sensor of a file. Raises `RefusedFileError` where it was signed for another gateway."""
    if not all(origin.get(key) for key in GATEWAY_KEYS):
        raise RefusedFileError("foreign: no gateway wrote it")
    claimed = "/".join(origin[key] for key in GATEWAY_KEYS)
    name = claimed if signed_for is None else signed_for.removeprefix(KEY_PREFIX)
    if GATEWAY_KEY.fullmatch(KEY_PREFIX + name) is None or name != claimed:
        raise RefusedFileError(f"forged: says that it is of {claimed}, and is signed for {name}")
    return name


def _check_times(rows: SegmentRows) -> None:
    """Raise `RefusedFileError` for times that no gateway has: each would make a day of its own in the tables."""
    if not 0 < rows.from_ns <= rows.to_ns < MAX_TIME_NS or rows.to_ns - rows.from_ns > MAX_SPAN_NS:
        raise RefusedFileError("has no message of the last decades, or lasts longer than two days")
    if not 0 < rows.from_ns + rows.wall_offset_ns < MAX_TIME_NS:
        raise RefusedFileError("states a clock that is decades wrong")


def _trust(found: FileVerification, key: str) -> Trust:
    """Return what a file is worth: changed content is refused, missing signatures are not."""
    if any(not problem.startswith(NOT_WHOLE) for problem in found.problems):
        return "refused"
    signed = found.statement is not None and found.statement.public_key
    if found.problems or not signed or found.unsigned_bytes:
        return "unsigned"
    return "verified" if key else "consistent"
