"""`plumbline fleet metrics`: the metrics of all gateways on a router, over HTTP."""

import argparse
import socket
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import parse_address, parsed_by
from gateway.cli.bus_link import add_connect, client_credentials, connect_endpoint
from gateway.cli.optional_dependencies import require_http

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from gateway.bus.fleet_client import FleetClient
    from gateway.fleet.fleet_state import FleetState

DEFAULT_LISTEN = "127.0.0.1:9321"
LOOPBACK = ("127.0.0.1", "localhost")
MOST_CONNECTIONS = 32


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "metrics",
        help="serve the metrics of all gateways on a router to Prometheus",
        description="Serve the metrics of all gateways on a router at /metrics, in the Prometheus text format, until Ctrl-C.",
        epilog="example: plumbline fleet metrics --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    verb.add_argument(
        "--listen",
        type=parsed_by(parse_address),
        default=parse_address(DEFAULT_LISTEN),
        metavar="ADDRESS:PORT",
        help=f"where to serve (default {DEFAULT_LISTEN}: only this machine)",
    )
    verb.add_argument(
        "--expect", type=Path, metavar="FILE", help="gateways that must be there, one <site>/<crane>/<sensor> a line"
    )
    add_connect(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_http()
    import uvicorn

    from gateway.bus.fleet_client import FleetClient
    from gateway.errors import InputError
    from gateway.fleet.expected_gateways import read_expected
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.selection import NamePatterns

    expected = {} if arguments.expect is None else read_expected(arguments.expect)
    host, port = arguments.listen
    try:
        listener = socket.create_server((host, port))
    except OSError as error:
        raise InputError(f"{host}:{port} cannot be used ({error.strerror}); choose another --listen") from error
    with listener:
        client = FleetClient(connect_endpoint(arguments), NamePatterns().key_pattern, client_credentials(arguments))
        try:
            client.request_latest()
            hosts = list(LOOPBACK) if host in LOOPBACK else ["*"]
            application = make_exporter(client, FleetState(frozenset(expected)), hosts)
            server = uvicorn.Server(
                uvicorn.Config(
                    application,
                    lifespan="off",
                    access_log=False,
                    log_level="warning",
                    limit_concurrency=MOST_CONNECTIONS,
                )
            )
            print(f"serving the metrics of all gateways at http://{host}:{port}/metrics", flush=True)
            server.run(sockets=[listener])
        finally:
            client.close()
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
        state.receive(client.inbox.drain())
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
