"""`plumbline keys`: the certificates of a site: its CA, those of gateways and people, renewal and revocation."""

import argparse
import re
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import day_count
from gateway.cli.command import AddTo, command, option

if TYPE_CHECKING:
    from gateway.pki.site_folder import SiteFolder

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
CA_DAYS, HOLDER_DAYS = 3650, 730
"""Validity of the authority and of its holders. Basis: a choice; ten years of a crane's electronics, and two years between
visits."""
SOON_DAYS = 60
"""Basis: a choice; time for a visit at every crane."""
HOLDERS = ("gateway", "router", "operator", "service")
FOLDER_OPTION = option(
    "--folder",
    type=Path,
    default=Path("plumbline-keys"),
    metavar="FOLDER",
    help="folder of the CA (default %(default)s)",
)
HOLDER_OPTION = option("name", metavar="NAME", help="of the gateway or person")


def _validity(default: int) -> AddTo:
    return option("--days", type=day_count, default=default, help="validity (default %(default)s)")


@command(
    "init",
    "make the CA of a site",
    None,
    "example: plumbline keys init --site yard",
    FOLDER_OPTION,
    option("--site", required=True, metavar="NAME", help="name of the site"),
    _validity(CA_DAYS),
)
def run_init(arguments: argparse.Namespace) -> int:
    """Make the folder of the CA."""
    from gateway.extras import require_extra

    require_extra("security")
    from gateway.pki.site_folder import SiteFolder, utc_now

    folder = SiteFolder.create(arguments.folder, _checked(arguments.site), arguments.days, utc_now())
    print(f"{folder.path}: CA of {arguments.site}, valid until {_date(folder.identity.valid_until)}")
    print("keep the folder, and a copy of it, away from the gateways; ca-key.pem is the key to all of them")
    return 0


@command(
    "issue",
    "issue a certificate",
    None,
    "example: plumbline keys issue gateway crane-1 --host 10.0.0.5",
    FOLDER_OPTION,
    option(
        "holder",
        choices=HOLDERS,
        metavar="HOLDER",
        help="gateway, router, operator (may read and acknowledge) or service",
    ),
    option(
        "name",
        metavar="NAME",
        help="of a gateway its crane, or <crane>.<sensor>, so that it vouches for the signing key; of the person, as audits and "
        "records show it",
    ),
    option("--host", action="append", default=[], help="address or name under which it is reached; may be repeated"),
    _validity(HOLDER_DAYS),
)
def run_issue(arguments: argparse.Namespace) -> int:
    """Issue a certificate, with its key."""
    folder, now = _open(arguments)
    from gateway.pki.site_folder import Holder

    name = _checked(arguments.name)
    made = folder.issue(name, Holder(arguments.holder), arguments.host, arguments.days, now)
    print(f"{made}: {arguments.holder} {name}, valid for {arguments.days} days")
    print(_use(arguments.holder, made))
    return 0


@command(
    "renew",
    "issue a new key and certificate for a name",
    None,
    "example: plumbline keys renew crane-1",
    FOLDER_OPTION,
    HOLDER_OPTION,
    _validity(HOLDER_DAYS),
)
def run_renew(arguments: argparse.Namespace) -> int:
    """Issue a new key and certificate."""
    folder, now = _open(arguments)
    made = folder.renew(_checked(arguments.name), arguments.days, now)
    print(
        f"{made}: new key and certificate of {arguments.name}, valid for {arguments.days} days; replace the files with them"
    )
    print(
        "the certificate before stays valid until it expires, or until "
        f"plumbline keys revoke {arguments.name} --keep-newest, once the new one is in use"
    )
    return 0


@command(
    "revoke",
    "put the certificates of a name on the revocation list",
    None,
    "examples:\n  plumbline keys revoke ann\n  plumbline keys revoke crane-1 --keep-newest     # after a renewal",
    FOLDER_OPTION,
    HOLDER_OPTION,
    option("--keep-newest", action="store_true", help="revoke those before the newest, after a renewal"),
)
def run_revoke(arguments: argparse.Namespace) -> int:
    """Revoke the certificates of a name."""
    folder, now = _open(arguments)
    count = folder.revoke(_checked(arguments.name), now, keep_newest=arguments.keep_newest)
    counted = "1 certificate" if count == 1 else f"{count} certificates"
    print(f"{counted} of {arguments.name} revoked; copy {folder.path}/revoked.pem to bus.tls.revoked of each gateway")
    if count > 1 and not arguments.keep_newest:
        print(
            f"WARNING: the newest is among them, and {arguments.name} has no valid certificate now; after a renewal "
            f"--keep-newest spares it; plumbline keys renew {arguments.name} issues another"
        )
    print(
        "their commands are refused at once; for their links also remove the name from bus.access, and restart the gateway"
    )
    return 0


@command(
    "list",
    "list the certificates with their expiry",
    None,
    "example: plumbline keys list --folder plumbline-keys",
    FOLDER_OPTION,
)
def run_list(arguments: argparse.Namespace) -> int:
    """Print the certificates."""
    folder, now = _open(arguments)
    ca = folder.identity
    print(f"{'CA':<10} {ca.name:<24} {_date(ca.valid_until)}  {_state(ca.valid_until, now, revoked=False)}")
    for one in folder.issued():
        identity = one.identity
        state = _state(identity.valid_until, now, revoked=one.revoked)
        print(f"{identity.holder:<10} {identity.name:<24} {_date(identity.valid_until)}  {state}")
    return 0


def _open(arguments: argparse.Namespace) -> "tuple[SiteFolder, datetime]":
    from gateway.extras import require_extra

    require_extra("security")
    from gateway.pki.site_folder import SiteFolder, utc_now

    return SiteFolder(arguments.folder), utc_now()


def _checked(name: str) -> str:
    from gateway.errors import InputError

    if not NAME.fullmatch(name):
        raise InputError(
            f"{name!r} is not a name of letters, digits and . _ - (at most 64, and it begins with a letter or digit)"
        )
    return name


def _use(holder: str, folder: Path) -> str:
    if holder in ("gateway", "router"):
        return f"copy the folder to the {holder} (key.pem: mode 0600, owner plumbline); bus.tls names its files"
    return f"give the folder to that person alone; they use it by --credentials {folder.name} or PLUMBLINE_CREDENTIALS"


def _date(at: datetime) -> str:
    return f"{at:%Y-%m-%d}"


def _state(valid_until: datetime, now: datetime, *, revoked: bool) -> str:
    days = (valid_until - now).days
    if revoked:
        return "revoked"
    if days < 0:
        return "EXPIRED"
    return f"{days} days left" + (": renew it" if days < SOON_DAYS else "")
