"""`plumbline fleet page` and `fleet metrics`: the cranes of a site over HTTP, for people and for Prometheus."""

import argparse
import socket
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from gateway.cli.options.argument_types import parsed_by
from gateway.cli.options.bus_link import add_connect, add_expect, expected_gateways, fleet_client
from gateway.configuration.section import host_and_port, written
from gateway.extras import require_extra
from gateway.languages import LANGUAGES
from gateway.page.listener import listen_at

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from gateway.bus.fleet_client import FleetClient
    from gateway.fleet.fleet_state import FleetState

FLEET_PAGE_LISTEN = "127.0.0.1:8322"
METRICS_LISTEN = "127.0.0.1:9321"
LOOPBACK_HOSTS = ("127.0.0.1", "localhost")
MAX_WAITING_CONNECTIONS = 64
"""Connections that wait to be accepted. Basis: a choice; a fleet that comes back together, and a bound of the memory."""
MAX_COLLECTOR_CONNECTIONS = 32
"""Basis: a choice; collectors are a few, and each costs a file."""


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add both verbs."""
    _add_page(verbs)
    _add_metrics(verbs)


def _add_page(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    verb = verbs.add_parser(
        "page",
        help="serve a page with a card for each crane, what asks for action first",
        description="Serve a page with a card for each gateway on a router: state, swing, trust and age, what asks for action "
        "first, until Ctrl-C. A card links to the crane's own page where the gateway states its address (page.url).",
        epilog="example: plumbline fleet page --listen 127.0.0.1:8322 --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    _add_listen(verb, FLEET_PAGE_LISTEN)
    verb.add_argument(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name under which browsers may reach the page, beside its address; repeatable",
    )
    verb.add_argument(
        "--language", choices=LANGUAGES, default="en", metavar="CODE", help="language, such as de (default %(default)s)"
    )
    add_expect(verb)
    add_connect(verb)
    verb.set_defaults(run=_serve_page)


def _add_metrics(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    verb = verbs.add_parser(
        "metrics",
        help="serve the metrics of all gateways on a router to Prometheus",
        description="Serve the metrics of all gateways on a router at /metrics, in the Prometheus text format, until Ctrl-C.",
        epilog="example: plumbline fleet metrics --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    _add_listen(verb, METRICS_LISTEN)
    add_expect(verb)
    add_connect(verb)
    verb.set_defaults(run=_serve_metrics)


def _add_listen(verb: argparse.ArgumentParser, default: str) -> None:
    """Add `--listen`."""
    verb.add_argument(
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


def _serve_page(arguments: argparse.Namespace) -> int:
    require_extra("page")
    from gateway.cli.fleet.fleet_status import LiveFleet
    from gateway.fleet.fleet_page import FleetPage
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.report import FleetQuery
    from gateway.fleet.selection import NamePatterns
    from gateway.page.http_server import log_to_stderr

    state = FleetState(expected_gateways(arguments))
    host, port = arguments.listen
    with _open_listener(arguments) as listener, fleet_client(arguments, NamePatterns().key_pattern) as client:
        log_to_stderr("fleet page")
        fleet = LiveFleet(client, state, FleetQuery())
        print(f"serving the page of all cranes at http://{written(host, port)}/", flush=True)
        FleetPage(fleet.report, listener, arguments.language, [host, *arguments.host]).run()
    return 0


def _serve_metrics(arguments: argparse.Namespace) -> int:
    require_extra("page")
    import uvicorn

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


def make_exporter(client: "FleetClient", state: "FleetState", hosts: list[str]) -> "Starlette":
    """Make the routes; `hosts` are the names under which the exporter may be asked."""
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.routing import Route

    from gateway.fleet.fleet_metrics import format_fleet
    from gateway.page.exposition import CONTENT_TYPE

    async def metrics(_request: Request) -> Response:
        state.receive(client.receive())
        now_s = time.monotonic()
        text = format_fleet(
            state.evidence(now_s),
            state.statuses(now_s, datetime.now(UTC)),
            connected=client.connected,
            invalid=state.invalid + client.inbox.refused,
        )
        return Response(text, media_type=CONTENT_TYPE)

    guard = Middleware(TrustedHostMiddleware, allowed_hosts=hosts)
    return Starlette(routes=[Route("/metrics", metrics)], middleware=[guard])
