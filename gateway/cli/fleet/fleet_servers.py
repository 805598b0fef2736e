"""`plumbline fleet page` and `fleet metrics`: the cranes of a site over HTTP, for people and for Prometheus."""

import argparse
import socket

from gateway.cli.argument_types import parsed_by
from gateway.cli.bus_link import CONNECT_OPTIONS, EXPECT_OPTION, expected_gateways, fleet_client
from gateway.cli.command import AddTo, command, option
from gateway.configuration.section import host_and_port, written
from gateway.extras import require_extra
from gateway.languages import LANGUAGES
from gateway.page.channel import listen_at

FLEET_PAGE_LISTEN = "127.0.0.1:8322"
METRICS_LISTEN = "127.0.0.1:9321"
LOOPBACK_HOSTS = ("127.0.0.1", "localhost")
MAX_WAITING_CONNECTIONS = 64
"""Connections that wait to be accepted. Basis: a choice; a fleet that comes back together, and a bound of the memory."""
MAX_COLLECTOR_CONNECTIONS = 32
"""Basis: a choice; collectors are a few, and each costs a file."""


def _listen(default: str) -> AddTo:
    """Return `--listen`."""
    return option(
        "--listen",
        type=parsed_by(host_and_port),
        default=host_and_port(default),
        metavar="ADDRESS:PORT",
        help=f"where to serve (default {default}: only this machine)",
    )


def _open_listener(arguments: argparse.Namespace) -> socket.socket:
    """Listen at the address of `--listen`. Raises `InputError`."""
    from gateway.errors import InputError

    host, port = arguments.listen
    try:
        return listen_at(host, port, MAX_WAITING_CONNECTIONS)
    except OSError as error:
        raise InputError(f"{written(host, port)} cannot be used ({error.strerror}); choose another --listen") from error


@command(
    "page",
    "serve a page with a card for each crane, what asks for action first",
    "Serve a page with a card for each gateway on a router: state, swing, trust and age, what asks for action "
    "first, until Ctrl-C. A card links to the crane's own page where the gateway states its address (page.url).",
    "example: plumbline fleet page --listen 127.0.0.1:8322 --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    _listen(FLEET_PAGE_LISTEN),
    option(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name under which browsers may reach the page, beside its address; repeatable",
    ),
    option(
        "--language", choices=LANGUAGES, default="en", metavar="CODE", help="language, such as de (default %(default)s)"
    ),
    EXPECT_OPTION,
    *CONNECT_OPTIONS,
)
def run_page(arguments: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    require_extra("page")
    from gateway.cli.fleet.fleet_status import LiveFleet
    from gateway.fleet.fleet_servers import FleetPage
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.report import FleetQuery
    from gateway.fleet.selection import NamePatterns
    from gateway.page.http_server import log_to_stderr

    state = FleetState(expected_gateways(arguments))
    host, port = arguments.listen
    pattern = NamePatterns().key_pattern
    with _open_listener(arguments) as listener, fleet_client(arguments, pattern, ("motion",)) as client:
        log_to_stderr("fleet page")
        fleet = LiveFleet(client, state, FleetQuery())
        print(f"serving the page of all cranes at http://{written(host, port)}/", flush=True)
        FleetPage(fleet.report, listener, arguments.language, [host, *arguments.host]).run()
    return 0


@command(
    "metrics",
    "serve the metrics of all gateways on a router to Prometheus",
    "Serve the metrics of all gateways on a router at /metrics, in the Prometheus text format, until Ctrl-C.",
    "example: plumbline fleet metrics --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    _listen(METRICS_LISTEN),
    EXPECT_OPTION,
    *CONNECT_OPTIONS,
)
def run_metrics(arguments: argparse.Namespace) -> int:
    """Serve the metrics until Ctrl-C."""
    require_extra("page")
    import uvicorn

    from gateway.fleet.fleet_servers import make_exporter
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.selection import NamePatterns

    state = FleetState(expected_gateways(arguments))
    host, port = arguments.listen
    with _open_listener(arguments) as listener, fleet_client(arguments, NamePatterns().key_pattern) as client:
        client.request_latest()
        hosts = list(LOOPBACK_HOSTS) if host in LOOPBACK_HOSTS else ["*"]
        server = uvicorn.Server(
            uvicorn.Config(
                make_exporter(client, state, hosts),
                lifespan="off",
                access_log=False,
                log_level="warning",
                limit_concurrency=MAX_COLLECTOR_CONNECTIONS,
            )
        )
        print(f"serving the metrics of all gateways at http://{written(host, port)}/metrics", flush=True)
        server.run(sockets=[listener])
    return 0
