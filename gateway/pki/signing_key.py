"""The gateway's Ed25519 key (RFC 8032), with which recordings are signed, and the check of its signatures.

The package `cryptography` is an extra: without it recordings are chained by hashes and not signed.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.atomic_io import write_private
from gateway.errors import PlumblineError
from gateway.extras import what_is_missing
from gateway.file_input import read_bounded, reason_of

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

KEY_NAME = "signing-key.pem"
PUBLIC_SUFFIX = ".pub"


class KeyFileError(PlumblineError):
    """A key cannot be read or made; the text names the file and the remedy."""


class SigningKey:
    """The private half of the key."""

    def __init__(self, private: Ed25519PrivateKey) -> None:
        self._private = private
        self.public_hex = private.public_key().public_bytes_raw().hex()

    def sign(self, text: str) -> str:
        """Return the signature of a text, in hexadecimal digits."""
        return self._private.sign(text.encode()).hex()


def fingerprint(public_hex: str) -> str:
    """Return the first 64 bits of a public key's SHA-256, in groups of four digits, for people to compare."""
    digest = hashlib.sha256(bytes.fromhex(public_hex)).hexdigest()[:16]
    return "-".join(digest[i : i + 4] for i in range(0, 16, 4))


def load_or_create_key(path: Path) -> SigningKey | None:
    """Return the key of a file, which is made with mode 0600 where there is none; None without the extra `signing`.

    The public half stands beside it, in a file that ends with `.pub`. Raises `KeyFileError`.
    """
    if what_is_missing("signing") is not None:
        return None
    from cryptography.exceptions import InternalError, UnsupportedAlgorithm  # noqa: PLC0415  (an extra)
    from cryptography.hazmat.primitives import serialization  # noqa: PLC0415  (an extra)
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415

    try:
        if is_new := not path.exists():
            private = Ed25519PrivateKey.generate()
            pem = private.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
            write_private(path, pem, 0o600)
        loaded = serialization.load_pem_private_key(read_bounded(path), password=None)
        if not isinstance(loaded, Ed25519PrivateKey):
            raise KeyFileError(f"{path}: is not an Ed25519 key; give one in PEM, or move it away so that one is made")
        key = SigningKey(loaded)
        public = path.with_name(path.name + PUBLIC_SUFFIX)
        if is_new or not public.exists():
            write_private(public, f"{key.public_hex}\n".encode(), 0o644)
    except OSError as error:
        raise KeyFileError(
            f"{path}: {error.strerror or error}; set recorder.key to a path that this user may write"
        ) from error
    except (ValueError, TypeError, UnsupportedAlgorithm, InternalError) as error:
        raise KeyFileError(
            f"{path}: is not an unencrypted private key in PEM; move it away so that one is made"
        ) from error
    return key


def read_public_key(text: str) -> str:
    """Return a public key in hexadecimal digits, given so or as the name of a `.pub` file. Raises `KeyFileError`."""
    with suppress(ValueError):
        if len(bytes.fromhex(text)) == 32:
            return text.lower()
    path = Path(text)
    try:
        content = read_bounded(path).decode().strip()
        if len(bytes.fromhex(content)) == 32:
            return content.lower()
    except OSError as error:
        raise KeyFileError(f"--key {text}: {reason_of(error).lower()}; give the gateway's {KEY_NAME}.pub") from error
    except ValueError:
        pass
    raise KeyFileError(f"--key {text}: is not a public key of 64 hexadecimal digits; give the gateway's {KEY_NAME}.pub")


def is_valid(public_hex: str, text: str, signature_hex: str) -> bool:
    """Return whether a signature belongs to a text and a public key. Raises `KeyFileError` without the extra `signing`."""
    if (missing := what_is_missing("signing")) is not None:
        raise KeyFileError(f"signatures cannot be checked: {missing}")
    from cryptography.exceptions import InvalidSignature  # noqa: PLC0415  (an extra)
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey  # noqa: PLC0415

    try:
        Ed25519PublicKey.from_public_bytes(bytes.fromhex(public_hex)).verify(
            bytes.fromhex(signature_hex), text.encode()
        )
    except (InvalidSignature, ValueError):
        return False
    return True
