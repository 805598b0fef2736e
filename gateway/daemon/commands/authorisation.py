"""What commands are authorised by: certificates where the site has a CA, else the token of the service's group."""

import logging
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.atomic_io import write_private
from gateway.authorization.credential import TOKEN_BYTES, TOKEN_NAME, Authoriser, parse_token
from gateway.configuration.bus_section import TlsSection
from gateway.errors import PlumblineError
from gateway.extras import what_is_missing
from gateway.file_input import read_bounded
from gateway.pki.signing_key import SigningKey

if TYPE_CHECKING:
    from gateway.daemon.commands.site_certificates import SiteCertificates  # its library is an extra

log = logging.getLogger("plumbline.security")
TOKEN_MODE = 0o640
OTHERS = 0o007


def read_certificates(tls: TlsSection) -> "SiteCertificates | None":
    """Return the certificates of a site; None without a CA, or without the library that reads them."""
    if not tls.enabled:
        return None
    if (missing := what_is_missing("security")) is not None:
        log.error("bus.tls: %s; commands are refused", missing)
        return None
    from gateway.daemon.commands.site_certificates import SiteCertificates  # noqa: PLC0415 (an extra)

    return SiteCertificates(tls)


def make_voucher_source(
    gateway: str, key: Callable[[], SigningKey | None], certificates: "SiteCertificates | None"
) -> Callable[[], str | None]:
    """Return a function that returns what vouches for the gateway's key in JSON; None while nothing does."""

    def voucher() -> str | None:
        if certificates is None or (present := key()) is None:
            return None
        made = certificates.voucher(gateway, present.public_hex)
        return None if made is None else made.model_dump_json()

    return voucher


def make_authoriser(
    boot_id: str, data_dir: Path, tls: TlsSection, certificates: "SiteCertificates | None"
) -> Authoriser:
    """Return the authoriser of a boot. Where the certificates cannot be used it refuses every command, and why is logged."""
    if not tls.enabled:
        return Authoriser(boot_id, load_or_create_token(data_dir))
    if certificates is not None:
        try:
            return Authoriser(boot_id, certificates.verifier())
        except PlumblineError as error:
            log.error("bus.tls.ca %s; commands are refused until the next start", error)
    return refuse_all(boot_id)


def refuse_all(boot_id: str) -> Authoriser:
    """Return an authoriser that refuses every command: its secret is one that nobody has."""
    return Authoriser(boot_id, secrets.token_bytes(TOKEN_BYTES))


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
        write_private(path, f"{secret.hex()}\n".encode(), TOKEN_MODE)
    except (OSError, UnicodeDecodeError) as error:
        log.error("%s: cannot be used (%s); commands are refused", path, getattr(error, "strerror", None) or error)
        return secrets.token_bytes(TOKEN_BYTES)
    return secret
