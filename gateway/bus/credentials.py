"""The credentials of a client: the command tokens that this user may read."""

import os
from collections.abc import Iterable
from pathlib import Path

from gateway.authorization.credential import Challenge
from gateway.authorization.token import TOKEN_NAME, parse_token, prove_by_token, token_id
from gateway.configuration.known_data_folders import known_data_folders
from gateway.configuration.loading import load
from gateway.configuration.service_configuration import is_installed, load_installed
from gateway.errors import InputError, PlumblineError

VARIABLE = "PLUMBLINE_CREDENTIALS"


class Credentials:
    """What a client can prove."""

    def __init__(self, tokens: Iterable[bytes]) -> None:
        self._tokens = {token_id(secret): secret for secret in tokens}

    def prove(self, key_expr: str, payload: bytes, challenge: Challenge) -> bytes | None:
        """Return the attachment that proves a request, or None without the credential that the gateway asks for."""
        secret = self._tokens.get(challenge.token_id or "")
        if secret is None:
            return None
        return prove_by_token(secret, key_expr, payload, challenge).model_dump_json().encode()


def load_credentials(folder: Path | None = None) -> Credentials:
    """Return the credentials of a folder, of `$PLUMBLINE_CREDENTIALS`, or of the gateways of this machine.

    Raises `InputError` for a named folder without credentials.
    """
    named = folder or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    if named is None:
        return Credentials(secret for place in _usual_folders() if (secret := _read_token(place)) is not None)
    secret = _read_token(named)
    if secret is None:
        raise InputError(f"{named}: has no readable {TOKEN_NAME}; name the gateway's data folder by --credentials")
    return Credentials([secret])


def _usual_folders() -> Iterable[Path]:
    """Yield the data folder of the default configuration, the installed one, and those of gateways that this user has run."""
    try:
        yield load(None).gateway.data_dir
        if is_installed():
            yield load_installed().gateway.data_dir
    except PlumblineError:
        pass  # a configuration that this user may not read has no token that this user may read
    yield from known_data_folders()


def _read_token(folder: Path) -> bytes | None:
    try:
        return parse_token((folder / TOKEN_NAME).read_text(encoding="ascii"))
    except (OSError, UnicodeDecodeError):
        return None
