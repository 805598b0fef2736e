"""`plumbline fleet page`: the cranes of a site on one page."""

import argparse

from gateway.cli.fleet.fleet_options import add_expect, add_listen, expected_gateways, fleet_client, open_listener
from gateway.cli.options.argument_types import require_extra
from gateway.cli.options.bus_link import add_connect
from gateway.languages import LANGUAGES

FLEET_PAGE_LISTEN = "127.0.0.1:8322"


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "page",
        help="serve a page with a card for each crane, what asks for action first",
        description="Serve a page with a card for each gateway on a router: state, swing, trust and age, what asks for action "
        "first, until Ctrl-C. A card links to the crane's own page where the gateway states its address (page.url).",
        epilog="example: plumbline fleet page --listen 127.0.0.1:8322 --connect tcp/10.0.0.2:7447 --expect gateways.txt",
    )
    add_listen(verb, FLEET_PAGE_LISTEN)
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
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_extra("page")
    from gateway.cli.fleet.fleet_status import LiveFleet
    from gateway.fleet.fleet_page import FleetPage
    from gateway.fleet.fleet_state import FleetState
    from gateway.fleet.report import FleetQuery
    from gateway.fleet.selection import NamePatterns
    from gateway.page.http_server import log_to_stderr

    state = FleetState(expected_gateways(arguments))
    host, port = arguments.listen
    with open_listener(arguments) as listener, fleet_client(arguments, NamePatterns().key_pattern) as client:
        log_to_stderr("fleet page")
        fleet = LiveFleet(client, state, FleetQuery())
        print(f"serving the page of all cranes at http://{host}:{port}/", flush=True)
        FleetPage(fleet.report, listener, arguments.language, [host, *arguments.host]).run()
    return 0
