"""The option `--ca` of commands that verify recordings: the site's CA vouches for the keys of gateways."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.bus.known_gateways import RefuseKey


def add_ca(verb: argparse.ArgumentParser) -> None:
    """Add the option."""
    verb.add_argument(
        "--ca",
        type=Path,
        metavar="FILE",
        help="ca.pem of the site: its CA must vouch today for the key, by the certificate of the gateway in the recordings; a "
        "revoked.pem beside it counts",
    )


def refusal_by(ca: Path) -> "RefuseKey":
    """Return what says why a CA does not vouch for a key. Raises `InputError` where the file has none."""
    require_extra("security")
    from gateway.authorization.certificates import SiteAuthority
    from gateway.errors import InputError
    from gateway.pki.inspect import CertificateError, parse_authorities

    try:
        parse_authorities(ca.read_bytes())
    except (OSError, CertificateError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"--ca {ca}: {reason}; give the ca.pem that plumbline keys has made") from error
    return SiteAuthority(ca, ca.with_name("revoked.pem")).refuse
