"""The token scheme: a secret that only the service's group can read, on a gateway that listens on loopback alone."""

import hashlib
import hmac

from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.credential import Challenge, RequestStatement, TokenCredential, make_statement

TOKEN_NAME = "command-token"
TOKEN_BYTES = 32
"""Basis: 256 random bits cannot be guessed."""


def parse_token(text: str) -> bytes | None:
    """Return the secret in the content of a token file; None where it is not one."""
    try:
        secret = bytes.fromhex(text.strip())
    except ValueError:
        return None
    return secret if len(secret) == TOKEN_BYTES else None


def token_id(secret: bytes) -> str:
    """Return the public id of a token, from which the secret cannot be computed."""
    return hashlib.sha256(b"plumbline-token-id" + secret).hexdigest()[:16]


def prove_by_token(secret: bytes, key_expr: str, payload: bytes, challenge: Challenge) -> TokenCredential:
    """Return the credential of a request."""
    mac = _mac(secret, make_statement(key_expr, payload, challenge))
    return TokenCredential(boot_id=challenge.boot_id, time_ns=challenge.time_ns, token_id=token_id(secret), mac=mac)


def authenticate_token(secret: bytes, credential: TokenCredential, statement: RequestStatement) -> Caller:
    """Return the caller, who may do everything; the request states the name. Raises `NotAuthorised`."""
    if not hmac.compare_digest(credential.mac, _mac(secret, statement)):
        raise NotAuthorised(
            "wrong_token",
            "the token is not that of this gateway, or the request was altered; "
            "name the folder of the gateway's command-token by --credentials",
        )
    return Caller(None, Role.SERVICE, "token")


def _mac(secret: bytes, statement: RequestStatement) -> str:
    return hmac.new(secret, statement.encode(), hashlib.sha256).hexdigest()
