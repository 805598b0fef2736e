"""The options that the verbs of `plumbline archive` share: the source, the table and the keys."""

import argparse
import hashlib
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.options.site_authority import add_ca, refusal_by

if TYPE_CHECKING:
    from gateway.archive.admission import Authority, KeyOf


def add_source(verb: argparse.ArgumentParser) -> None:
    """Add the source of the recordings."""
    verb.add_argument(
        "source",
        metavar="SOURCE",
        help="folder with recordings of any gateways, at any depth, or an object store: s3://bucket/prefix",
    )


def add_table(verb: argparse.ArgumentParser, option: str = "--table") -> None:
    """Add the place of the tables."""
    verb.add_argument(
        option,
        dest="table",
        required=True,
        metavar="TABLE",
        help="folder or object store with the tables, which plumbline archive index makes",
    )


def add_keys(verb: argparse.ArgumentParser) -> None:
    """Add the public keys of the gateways, and the CA that vouches for others."""
    verb.add_argument(
        "--keys",
        type=Path,
        metavar="FILE",
        help="public keys of the gateways: lines <site>/<crane>/<sensor> <64 digits, or a .pub file>; without one those that "
        "plumbline remote status has heard at the first contact",
    )
    add_ca(verb)


def authority_of(arguments: argparse.Namespace) -> "Authority | None":
    """Return the CA of the options. Raises `InputError`."""
    from gateway.archive.admission import Authority

    if arguments.ca is None:
        return None
    refuse = refusal_by(arguments.ca)
    return Authority(refuse, hashlib.sha256(arguments.ca.read_bytes()).hexdigest())


def keys(arguments: argparse.Namespace) -> "KeyOf":
    """Return the keys of the options. Raises `InputError` and `KeyFileError`."""
    from gateway.archive.admission import known_key, read_keys

    return known_key if arguments.keys is None else read_keys(arguments.keys)


def day(text: str) -> datetime:
    """Return the begin of a day, UTC. Raises `ValueError`."""
    try:
        begin = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text} is no day such as 2026-11-22") from None
    return begin if begin.tzinfo is not None else begin.replace(tzinfo=UTC)
