"""What this user has heard of gateways: the public key at the first contact, and the newest statement since.

A key that was heard once is pinned: another one is a difference, until a person deletes the file. Whoever holds the hash of a
statement can prove that the recording was written again, even with the gateway's own key.
"""

import hashlib
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from gateway.atomic_io import write_private
from gateway.authorization.credential import VOUCHER_FIELD
from gateway.configuration.user_state import user_state_folder
from gateway.errors import InputError
from gateway.file_input import decode_json, parse_json, read_bounded, reason_of
from gateway.messages import NewestStatement
from gateway.pki.signing_key import fingerprint
from gateway.topics import DEMO_SITE

FOLDER = "gateways"
LONGEST_CHALLENGE = 16_384
"""Longest answer to a challenge with a voucher, bytes. Basis: one has 1500 bytes; a certificate may have 4096."""
FIELD = "newest_statement"
DEEPEST = 8
"""Levels of JSON below which no statement is looked for. Basis: a choice; those of `remote status --json` are three deep."""
RefuseKey = Callable[[str, str, object], str | None]
"""Takes gateway, key and voucher as it came; returns why the site's CA does not vouch for the key, None: it does."""


@dataclass(frozen=True, slots=True)
class Signers:
    """The public keys of gateways that a person has put into a folder, or that lie in those of this machine."""

    read: Callable[[], Collection[str]] = tuple
    """Returns the keys that are there now."""
    are_all: bool = False
    """A person has named the folder: no other key is pinned at the first contact."""
    refuse: RefuseKey | None = None
    """Asks the site's CA; None: there is none here."""

    def judge_challenge(self, gateway: str, public_key: str, answer: bytes) -> str | None:
        """Return why the CA does not vouch for the key with which the answer to a challenge is signed; None: it does."""
        content = None
        with suppress(ValueError):
            content = parse_json(answer.decode()) if len(answer) <= LONGEST_CHALLENGE else None
        voucher = content.get(VOUCHER_FIELD) if isinstance(content, dict) else None
        if voucher is None or self.refuse is None:
            return "it has sent no voucher"
        return self.refuse(gateway, public_key, voucher)


NO_SIGNERS = Signers()


def remember_statement(heard: NewestStatement, environment: Mapping[str, str] = os.environ) -> str | None:
    """Pin the key of a gateway, and keep its newest statement; return what is wrong with it in a sentence, None: nothing."""
    path = _path(heard.gateway, environment)
    if path is None or not heard.public_key:
        return None
    known = _read(path, heard.gateway)
    if known is not None and known.public_key != heard.public_key:
        return (
            f"WRONG KEY: {heard.gateway} signs its recordings with {fingerprint(heard.public_key)}, and signed with "
            f"{fingerprint(known.public_key)} before; where that is right, delete {path}"
        )
    if known is None or heard.segment > known.segment:
        with suppress(OSError):
            write_private(path, msgspec.json.encode(heard), 0o600)
    return None


def can_pin(gateway: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether a name is that of one gateway, and there is a place to pin its key."""
    unnamed = f"/{DEMO_SITE}/" in gateway
    return not unnamed and _path(gateway, environment) is not None


def pin_key(gateway: str, public_key: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Pin the key of a gateway, in place of another one; return whether that was possible."""
    path = _path(gateway, environment)
    if path is None or not can_pin(gateway, environment):
        return False
    nothing_heard = NewestStatement(gateway=gateway, segment=0, sha256="", public_key=public_key)
    try:
        write_private(path, msgspec.json.encode(nothing_heard), 0o600)
    except OSError:
        return False
    return True


def known_statement(gateway: str, environment: Mapping[str, str] = os.environ) -> NewestStatement | None:
    """Return what was heard of a gateway; None: nothing."""
    path = _path(gateway, environment)
    return None if path is None else _read(path, gateway)


def read_statements(path: Path) -> list[NewestStatement]:
    """Return the statements in health messages that somebody kept, as JSON or as lines of JSON. Raises `InputError`."""
    try:
        content = read_bounded(path).decode()
        try:
            values = [parse_json(content)]
        except ValueError:
            values = [parse_json(line) for line in content.splitlines() if line.strip()]
    except OSError as error:
        raise InputError(f"--heard {path}: {reason_of(error).lower()}; check the path") from error
    except ValueError as error:
        raise InputError(
            f"--heard {path}: is no JSON; give health messages, as `remote status --json` writes"
        ) from error
    found = [statement for value in values for statement in _statements(value, DEEPEST)]
    if not found:
        raise InputError(f"--heard {path}: has no {FIELD}; give health messages, as `remote status --json` writes")
    return found


def _statements(value: Any, depth: int) -> Iterator[NewestStatement]:
    if isinstance(value, dict) and FIELD in value:
        with suppress(msgspec.ValidationError):
            yield msgspec.convert(value[FIELD], NewestStatement)
    elif isinstance(value, (dict, list)) and depth:
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _statements(inner, depth - 1)


def _read(path: Path, gateway: str) -> NewestStatement | None:
    try:
        known = decode_json(read_bounded(path), NewestStatement)
        bytes.fromhex(known.public_key)
    except (OSError, ValueError):
        return None
    return replace(known, gateway=gateway)


def _path(gateway: str, environment: Mapping[str, str]) -> Path | None:
    folder = user_state_folder(FOLDER, environment)
    return None if folder is None else folder / f"{hashlib.sha256(gateway.encode()).hexdigest()[:16]}.json"
