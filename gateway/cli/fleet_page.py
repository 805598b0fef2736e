"""`plumbline fleet page`: the cranes of a site on one page."""

import argparse
import socket
from pathlib import Path

from gateway.cli.argument_types import parse_address, parsed_by
from gateway.cli.bus_link import add_connect, client_credentials, connect_endpoint
from gateway.cli.optional_dependencies import require_http

DEFAULT_LISTEN = "127.0.0.1:8322"


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "page",
        help="serve a page with a card for each crane, what asks for action first",
        description="Serve a page with a card for each gateway on a router: state, swing, trust and age, what asks for action "
        "first, until Ctrl-C. A card links to the crane's own page where the gateway states its address (page.url).",
        epilog="example: plumbline fleet page --listen 127.0.0.1:8322 --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    verb.add_argument(
        "--listen",
        type=parsed_by(parse_address),
        default=parse_address(DEFAULT_LISTEN),
        metavar="ADDRESS:PORT",
        help=f"where to serve (default {DEFAULT_LISTEN}: only this machine)",
    )
    verb.add_argument(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name under which browsers may reach the page, beside its address; repeatable",
    )
    verb.add_argument("--language", choices=("en", "de"), default="en", help="language (default %(default)s)")
    verb.add_argument(
        "--expect", type=Path, metavar="FILE", help="gateways that must be there, one <site>/<crane>/<sensor> a line"
    )
    add_connect(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_http()
    from gateway.bus.fleet_client import FleetClient
    from gateway.cli.fleet_status import LiveFleet
    from gateway.errors import InputError
    from gateway.fleet.expected_gateways import read_expected
    from gateway.fleet.fleet_page import FleetPage
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.report import FleetQuery
    from gateway.fleet.selection import NamePatterns
    from gateway.page.http_server import log_to_stderr

    expected = {} if arguments.expect is None else read_expected(arguments.expect)
    host, port = arguments.listen
    try:
        listener = socket.create_server((host, port), backlog=64)
    except OSError as error:
        raise InputError(f"{host}:{port} cannot be used ({error.strerror}); choose another --listen") from error
    with listener:
        log_to_stderr("fleet page")
        client = FleetClient(connect_endpoint(arguments), NamePatterns().key_pattern, client_credentials(arguments))
        try:
            fleet = LiveFleet(client, FleetState(frozenset(expected)), FleetQuery())
            print(f"serving the page of all cranes at http://{host}:{port}/", flush=True)
            FleetPage(fleet.report, listener, arguments.language, [host, *arguments.host]).run()
        finally:
            client.close()
    return 0
