"""`plumbline fleet metrics`: the metrics of all gateways on a router, over HTTP."""

import argparse
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from gateway.cli.fleet.fleet_options import add_expect, add_listen, expected_gateways, fleet_client, open_listener
from gateway.cli.options.argument_types import require_extra
from gateway.cli.options.bus_link import add_connect

if TYPE_CHECKING:
    from starlette.applications import Starlette

    from gateway.bus.fleet_client import FleetClient
    from gateway.fleet.fleet_state import FleetState

METRICS_LISTEN = "127.0.0.1:9321"
LOOPBACK_HOSTS = ("127.0.0.1", "localhost")
MAX_COLLECTOR_CONNECTIONS = 32
"""Basis: a choice; collectors are a few, and each costs a file."""


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "metrics",
        help="serve the metrics of all gateways on a router to Prometheus",
        description="Serve the metrics of all gateways on a router at /metrics, in the Prometheus text format, until Ctrl-C.",
        epilog="example: plumbline fleet metrics --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    add_listen(verb, METRICS_LISTEN)
    add_expect(verb)
    add_connect(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_extra("page")
    import uvicorn

    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.selection import NamePatterns

    state = FleetState(expected_gateways(arguments))
    host, port = arguments.listen
    with open_listener(arguments) as listener, fleet_client(arguments, NamePatterns().key_pattern) as client:
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
        print(f"serving the metrics of all gateways at http://{host}:{port}/metrics", flush=True)
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
