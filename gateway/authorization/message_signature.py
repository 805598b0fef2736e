"""The gateway's signature of what it sends on the bus: it travels in an attachment, so that the payload stays as it is.

A message is signed with its key expression, the gateway's boot and its own time; an answer also with the question, which holds a
number that nobody else could foresee. An attachment is as small as it is strict: no two texts of it mean the same.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.authorization.credential import BootId, TimeNs
from gateway.pki.signing_key import SigningKey, is_valid

MAX_SIGNATURE_BYTES = 512
"""Largest attachment. Basis: one with the longest time has 300 bytes."""
SIGNATURE_FIELD = b',"signed":'
"""The last field of a refusal: the bus has no attachment for an error."""


class MessageSignature(BaseModel):
    """What travels beside a payload."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    boot_id: BootId
    time_ns: TimeNs
    """When it was signed, by the gateway's own time, which never steps within a boot."""
    public_key: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    signature: Annotated[str, Field(pattern=r"^[0-9a-f]{128}$")]
    """Ed25519 (RFC 8032), in hexadecimal digits."""

    def is_of_message(self, key_expr: str, payload: bytes) -> bool:
        """Return whether a message is signed so. Raises `KeyFileError` where signatures cannot be checked."""
        return self._is_valid(_message(key_expr, payload, self.boot_id, self.time_ns))

    def is_of_answer(self, key_expr: str, payload: bytes, question: "Question", *, accepted: bool) -> bool:
        """Return whether the answer to a question is signed so. Raises `KeyFileError` where signatures cannot be checked."""
        return self._is_valid(_answer(key_expr, payload, self.boot_id, self.time_ns, question, accepted=accepted))

    def _is_valid(self, statement: str) -> bool:
        return is_valid(self.public_key, statement, self.signature)


@dataclass(frozen=True, slots=True)
class Question:
    """A request as it was sent: its answer is signed for it alone."""

    payload: bytes
    attachment: bytes
    """A credential, or random bytes."""


class MessageSigner:
    """Signs with the key of a gateway. Called by the threads that send."""

    def __init__(self, key: Callable[[], SigningKey | None], boot_id: str, now_ns: Callable[[], int]) -> None:
        """`key` returns the key; None: nothing is signed. `now_ns` is gateway time."""
        self._key = key
        self._boot_id = boot_id
        self._now_ns = now_ns

    def sign_message(self, key_expr: str, payload: bytes) -> bytes | None:
        """Return the attachment of a message."""
        return self._sign(lambda time_ns: _message(key_expr, payload, self._boot_id, time_ns))

    def sign_answer(self, key_expr: str, payload: bytes, question: Question, *, accepted: bool) -> bytes | None:
        """Return the attachment of an answer."""
        return self._sign(
            lambda time_ns: _answer(key_expr, payload, self._boot_id, time_ns, question, accepted=accepted)
        )

    def _sign(self, statement: Callable[[int], str]) -> bytes | None:
        key, time_ns = self._key(), self._now_ns()
        if key is None:
            return None
        fields = {
            "boot_id": self._boot_id,
            "time_ns": time_ns,
            "public_key": key.public_hex,
            "signature": key.sign(statement(time_ns)),
        }
        return json.dumps(fields, separators=(",", ":")).encode()


def parse_signature(attachment: bytes | None) -> MessageSignature | None:
    """Return the signature in an attachment; None where it is none."""
    if attachment is None or len(attachment) > MAX_SIGNATURE_BYTES:
        return None
    try:
        return MessageSignature.model_validate_json(attachment)
    except ValidationError:
        return None


def join_signature(payload: bytes, attachment: bytes | None) -> bytes:
    """Return a refusal with its signature as the last field."""
    return payload if attachment is None else payload[:-1] + SIGNATURE_FIELD + attachment + b"}"


def split_signature(payload: bytes) -> tuple[bytes, bytes | None]:
    """Return a refusal and its signature as they were before they were joined."""
    content, field, rest = payload.rpartition(SIGNATURE_FIELD)
    return (content + b"}", rest[:-1]) if field and rest.endswith(b"}") else (payload, None)


def _message(key_expr: str, payload: bytes, boot_id: str, time_ns: int) -> str:
    """Return the text that is signed; no two messages have the same."""
    return json.dumps(["plumbline-message-1", key_expr, _hash(payload), boot_id, time_ns])


def _answer(key_expr: str, payload: bytes, boot_id: str, time_ns: int, question: Question, *, accepted: bool) -> str:
    asked = [_hash(question.payload), _hash(question.attachment)]
    return json.dumps(["plumbline-answer-1", key_expr, _hash(payload), boot_id, time_ns, *asked, accepted])


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
