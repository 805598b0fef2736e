"""The file of the command token: made at first start, and readable for the service's group alone."""

import logging
import secrets
from contextlib import suppress
from pathlib import Path

from gateway.atomic_io import write_private
from gateway.authorization.token import TOKEN_BYTES, TOKEN_NAME, parse_token
from gateway.file_input import read_bounded

log = logging.getLogger("plumbline.security")
MODE = 0o640
OTHERS = 0o007


def load_or_create_token(data_dir: Path) -> bytes:
    """Return the secret. If the file cannot be used it is a secret that nobody has: commands are refused, and why is logged."""
    path = data_dir / TOKEN_NAME
    try:
        with suppress(FileNotFoundError):
            secret = parse_token(read_bounded(path).decode("ascii"))
            if secret is None:
                log.error("%s: is damaged; move it away so that the next start makes one; commands are refused", path)
                return secrets.token_bytes(TOKEN_BYTES)
            if path.stat().st_mode & OTHERS:
                log.warning("%s: every user may read it; correct: chmod 0640 %s", path, path)
            return secret
        secret = secrets.token_bytes(TOKEN_BYTES)
        write_private(path, f"{secret.hex()}\n".encode(), MODE)
    except (OSError, UnicodeDecodeError) as error:
        log.error("%s: cannot be used (%s); commands are refused", path, getattr(error, "strerror", None) or error)
        return secrets.token_bytes(TOKEN_BYTES)
    return secret
