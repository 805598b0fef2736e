"""What commands are authorised by: certificates where the site has a CA, else the token of the service's group."""

import importlib.util
import logging
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.authorization.authoriser import Authoriser
from gateway.authorization.token import TOKEN_BYTES
from gateway.configuration.bus_section import TlsSection
from gateway.daemon.command_token import load_or_create_token
from gateway.errors import PlumblineError

if TYPE_CHECKING:
    from gateway.daemon.site_certificates import SiteCertificates  # its library is an extra

log = logging.getLogger("plumbline.security")
LIBRARY = "cryptography"


def read_certificates(tls: TlsSection) -> "SiteCertificates | None":
    """Return the certificates of a site; None without a CA, or without the library that reads them."""
    if not tls.enabled:
        return None
    if importlib.util.find_spec(LIBRARY) is None:
        log.error(
            "bus.tls: %s is not installed: pip install 'plumbline-gateway[security]'; commands are refused", LIBRARY
        )
        return None
    from gateway.daemon.site_certificates import SiteCertificates  # noqa: PLC0415 (an extra)

    return SiteCertificates(tls)


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
