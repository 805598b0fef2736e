"""The options that verbs of `plumbline fleet` share, and what they open."""

import argparse
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.options.argument_types import parse_address, parsed_by
from gateway.cli.options.bus_link import client_credentials, connect_endpoint

if TYPE_CHECKING:
    from gateway.bus.fleet_client import FleetClient

MAX_WAITING_CONNECTIONS = 64
"""Connections that wait to be accepted. Basis: a choice; a fleet that comes back together, and a bound of the memory."""


def add_expect(verb: argparse.ArgumentParser) -> None:
    """Add `--expect`."""
    verb.add_argument(
        "--expect", type=Path, metavar="FILE", help="gateways that must be there, one <site>/<crane>/<sensor> a line"
    )


def expected_gateways(arguments: argparse.Namespace) -> frozenset[str]:
    """Return the keys of the gateways that `--expect` names. Raises `InputError`."""
    from gateway.fleet.selection import read_expected

    return frozenset() if arguments.expect is None else frozenset(read_expected(arguments.expect))


def add_listen(verb: argparse.ArgumentParser, default: str) -> None:
    """Add `--listen`."""
    verb.add_argument(
        "--listen",
        type=parsed_by(parse_address),
        default=parse_address(default),
        metavar="ADDRESS:PORT",
        help=f"where to serve (default {default}: only this machine)",
    )


def open_listener(arguments: argparse.Namespace) -> socket.socket:
    """Listen at the address of `--listen`. Raises `InputError`."""
    from gateway.errors import InputError

    host, port = arguments.listen
    try:
        return socket.create_server((host, port), backlog=MAX_WAITING_CONNECTIONS)
    except OSError as error:
        raise InputError(f"{host}:{port} cannot be used ({error.strerror}); choose another --listen") from error


@contextmanager
def fleet_client(arguments: argparse.Namespace, key_pattern: str) -> Iterator["FleetClient"]:
    """Join the bus that `--connect` names, and leave it at the end; `key_pattern`: the gateways to listen to."""
    from gateway.bus.fleet_client import FleetClient

    client = FleetClient(connect_endpoint(arguments), key_pattern, client_credentials(arguments))
    try:
        yield client
    finally:
        client.close()
