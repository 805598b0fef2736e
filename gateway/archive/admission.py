"""The door of an archive: what a file claims to be, whether its signatures say so, and which files count.

Nothing counts twice, whatever was uploaded when: the answer depends on the files alone, never on the order in which they came or
on any clock.
"""

import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from devices.errors import RecordingError
from gateway.archive.rows import TRUST_RANK, IndexedFile, RecordingRow, Status, Trust
from gateway.archive.segment_rows import SegmentRows, read_rows
from gateway.archive.source import StoredFile
from gateway.bus.known_gateways import RefuseKey, known_statement
from gateway.bus.untrusted import GATEWAY_KEY
from gateway.errors import InputError
from gateway.fleet.selection import read_expected
from gateway.pki.signing_key import read_public_key
from gateway.recording.chain.chain_verification import VouchedKey, find_vouched_key
from gateway.recording.chain.file_verification import FileVerification, verify_file
from gateway.recording.chain.statements import SIGNATURE, hash_of, parse_statement
from gateway.recording.format.content import ORIGIN, segment_number
from gateway.recording.reading.recording_file import GATEWAY_KEYS, read_index
from gateway.topics import KEY_PREFIX

MAX_TIME_NS = 2**62
"""Latest time of a recording. Definition: the year 2116, far from where dates and sums overflow."""
MAX_SPAN_NS = 2 * 86_400_000_000_000
"""Longest recording. Basis: a choice; 48 times the longest segment that can be configured (an hour)."""
NOT_WHOLE = ("NOT SIGNED", "CUT:")
"""How problems begin that only say that a signature is missing; every other one says that something was changed."""

KeyOf = Callable[[str], str | None]
"""Takes `<site>/<crane>/<sensor>`; returns the gateway's public key, None: not known."""


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


def admit(
    stored: StoredFile, path: Path, key_of: KeyOf, authority: Authority | None = None
) -> tuple[IndexedFile, SegmentRows | None]:
    """Verify the copy of a file at a path and read its rows; one that cannot be taken is refused, with the reason and no rows."""
    sha256 = ""
    try:
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        return _admit(stored, path, sha256, key_of, authority)
    except OSError as error:
        refusal = RefusedFileError(f"cannot be read: {error.strerror or error}")
    except RecordingError as error:
        refusal = RefusedFileError(f"damaged: {str(error).removeprefix(f'{path}: ')}")
    except RefusedFileError as error:
        refusal = error
    row = RecordingRow(
        path=stored.path,
        version=stored.version,
        size_bytes=stored.size_bytes,
        status="refused",
        reason=str(refusal),
        given_key=refusal.given_key,
    )
    return IndexedFile(None, sha256, "refused", 0, row), None


def _admit(
    stored: StoredFile, path: Path, sha256: str, key_of: KeyOf, authority: Authority | None
) -> tuple[IndexedFile, SegmentRows]:
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
    row = RecordingRow(
        path=stored.path,
        version=stored.version,
        gateway_time_ns=rows.from_ns,
        end_utc=rows.to_ns + rows.wall_offset_ns,
        size_bytes=stored.size_bytes,
        status="counted",
        reason=reason,
        segment=found.segment or segment_number(origin) or None,  # a copy claims that of its original
        boot_id=origin.get("boot_id", ""),
        software=origin.get("software", ""),
        public_key="" if statement is None else statement.public_key,
        given_key=key,
        asked_ca=asked,
        statement_sha256=hash_of(found.statement_text) if found.statement_text else "",
        previous_sha256="" if statement is None else statement.previous_sha256,
        is_final=found.is_final,
        is_trimmed=statement is not None and bool(statement.replaces_sha256),
        unreadable=rows.losses.unreadable_messages + rows.losses.damaged_records,
    )
    return IndexedFile((site, crane, sensor), sha256, trust, rows.from_ns + rows.wall_offset_ns, row), rows


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


def judge_files(files: Iterable[IndexedFile]) -> list[IndexedFile]:
    """Return the files of one gateway with their status.

    Of equal files the first name counts. Of several versions of a segment of one start of the gateway, signed by the same key or
    not signed, the best one counts: first by trust, then the whole segment before a cut or a trimmed one, then the longest.
    What was deleted comes back under no name and in no other version, nor do the names of people in it.
    """
    files = list(files)
    reasons = {
        name: each.row.reason
        for each in files
        if each.row.status == "deleted"
        for name in (each.recording, segment_of(each))
    }
    nameless = {
        name: each.row.nameless for each in files if each.row.nameless for name in (each.recording, segment_of(each))
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
            row = replace(
                file.row,
                status=status,
                reason=file.row.reason if reason is None else reason,
                nameless=nameless.get(file.recording, nameless.get(segment_of(file), "")),
            )
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
