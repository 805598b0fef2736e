"""The options that name gateways on the bus, shared by all commands that talk to one or to many."""

import argparse
import os
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import option
from gateway.errors import printable

if TYPE_CHECKING:
    from gateway.bus.client import GatewayClient
    from gateway.bus.credentials import Credentials
    from gateway.bus.fleet_client import FleetClient

CONNECT_VARIABLE = "PLUMBLINE_CONNECT"
LOCAL_ENDPOINT = "tcp/127.0.0.1:7447"
MAX_ANSWER_WAIT_S = 30.0
"""Longest wait for an answer. Basis: a choice; three times the step that hangs (`commands.worker.PATIENCE_S`), and what a person
waits."""
CONNECT_OPTIONS = (
    option(
        "--connect",
        metavar="ENDPOINT",
        help=f"address of the gateway or router (default: ${CONNECT_VARIABLE}, the installed configuration, or {LOCAL_ENDPOINT})",
    ),
    option(
        "--credentials",
        type=Path,
        metavar="FOLDER",
        help="folder that plumbline keys issue has made, or the data folder of a gateway with its command-token "
        "(default: $PLUMBLINE_CREDENTIALS, or a gateway of this machine)",
    ),
)
"""`--connect` and `--credentials`."""
ADDRESS_OPTIONS = (
    option(
        "--gateway",
        default="plumbline/v1/*/*/*",
        metavar="KEY",
        help="plumbline/v1/<site>/<crane>/<sensor> (default: every gateway on the bus)",
    ),
    *CONNECT_OPTIONS,
)
"""`--gateway`, and the link to it."""
EXPECT_OPTION = option(
    "--expect", type=Path, metavar="FILE", help="gateways that must be there, one <site>/<crane>/<sensor> a line"
)
"""The gateways that must be there; `expected_gateways` returns them."""


def client_credentials(arguments: argparse.Namespace) -> "Credentials":
    """Return the credentials of the client. Raises `InputError` for a named folder without any."""
    from gateway.bus.credentials import load_credentials

    return load_credentials(arguments.credentials)


def connect_endpoint(arguments: argparse.Namespace) -> str:
    """Return the endpoint to connect to. Raises `ConfigurationError` for an installed configuration that cannot be read."""
    if arguments.connect is not None:
        return str(arguments.connect)
    if CONNECT_VARIABLE in os.environ:
        return os.environ[CONNECT_VARIABLE]
    from gateway.configuration.loading import is_installed, load_installed

    if not is_installed():
        return LOCAL_ENDPOINT
    return [*load_installed().bus.local_endpoints, LOCAL_ENDPOINT][0]


def expected_gateways(arguments: argparse.Namespace) -> frozenset[str]:
    """Return the keys of the gateways that `--expect` names. Raises `InputError`."""
    from gateway.fleet.selection import read_expected

    return frozenset() if arguments.expect is None else frozenset(read_expected(arguments.expect))


@contextmanager
def gateway_client(arguments: argparse.Namespace) -> "Iterator[GatewayClient]":
    """Join the bus that `--connect` names as a client of `--gateway`, and leave it at the end."""
    from gateway.bus.client import GatewayClient

    with closing(
        GatewayClient(connect_endpoint(arguments), arguments.gateway, client_credentials(arguments))
    ) as client:
        yield client
        if client.doubt is not None:
            print(f"plumbline: {client.key}: {printable(str(client.doubt))}", file=sys.stderr)


def fleet_client(
    arguments: argparse.Namespace, key_pattern: str, beside_states: tuple[str, ...] = ()
) -> "closing[FleetClient]":
    """Join the bus that `--connect` names, and leave it at the end.

    `key_pattern`: the gateways to listen to; `beside_states`: topics that are wanted, too.
    """
    from gateway.bus.fleet_client import FleetClient
    from gateway.topics import STATE_TOPICS

    topics = (*STATE_TOPICS, *beside_states)
    return closing(FleetClient(connect_endpoint(arguments), key_pattern, client_credentials(arguments), topics))
