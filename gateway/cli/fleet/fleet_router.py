"""`plumbline fleet router`: a router for a small site, or the configuration of zenohd for a large one."""

import argparse
import json
import signal
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.bus_link import LOCAL_ENDPOINT
from gateway.cli.command import command, option

if TYPE_CHECKING:
    import zenoh

    from gateway.bus.router import LatestStates
    from gateway.bus.session import TlsFiles

LINK_POLL_S = 0.5
"""Time between two looks at the links. Basis: a choice; a person sees a change at once, and it costs little."""
CLOSE_S = 2.0
"""Longest wait for the links to close at the end. Basis: a choice; a link closes in milliseconds, and an end waits no longer for
a dead one."""


@command(
    "router",
    "run a router that keeps the latest states, or print the configuration of zenohd",
    "Run a Zenoh router that keeps the last message of every gateway, until Ctrl-C. With --print-config, print "
    "the same as a configuration of zenohd with its storage plug-in, for large sites.",
    "examples: plumbline fleet router --listen tls/10.0.0.2:7447 --ca ca.pem --certificate certificate.pem "
    "--key key.pem --gateways gateways.txt --reader ann | plumbline fleet router --gateways gateways.txt --print-config "
    "> zenohd.json5",
    option(
        "--listen",
        action="append",
        metavar="ENDPOINT",
        help=f"where gateways and clients connect; may be repeated (default {LOCAL_ENDPOINT}: only this machine)",
    ),
    *(
        option(f"--{name}", type=Path, metavar="FILE", help=f"{what}, in PEM; all three for mutual TLS")
        for name, what in (
            ("ca", "certificate of the site's CA"),
            ("certificate", "certificate of this router"),
            ("key", "its key"),
        )
    ),
    option(
        "--gateways",
        type=Path,
        metavar="FILE",
        help="gateways that may publish: <site>/<crane>/<sensor> and the name of its certificate (default: the crane) a line",
    ),
    option(
        "--reader",
        action="append",
        default=[],
        metavar="NAME",
        help="certificate that may read and send requests; may be repeated",
    ),
    option(
        "--load-signal",
        action="append",
        default=[],
        metavar="NAME",
        help="certificate that may publish load signals; may be repeated",
    ),
    option(
        "--allow-unencrypted",
        action="store_true",
        help="listen beyond this machine without certificates: everyone may publish",
    ),
    option("--print-config", action="store_true", help="print the configuration of zenohd, and end"),
)
def run_router(arguments: argparse.Namespace) -> int:
    """Route until a signal, or print the configuration of zenohd."""
    from gateway.bus.router import router_configuration, with_storage
    from gateway.fleet.selection import read_expected

    listen = arguments.listen or [LOCAL_ENDPOINT]
    tls = _tls(arguments)
    _check_exposure(listen, tls is not None, arguments.allow_unencrypted)
    gateways = {} if arguments.gateways is None else read_expected(arguments.gateways)
    configuration = router_configuration(listen, tls, gateways, arguments.reader, arguments.load_signal)
    if arguments.print_config:
        print(json.dumps(with_storage(configuration), indent=2))
        return 0
    return _serve(configuration, listen, encrypted=tls is not None)


def _serve(configuration: dict[str, Any], endpoints: list[str], *, encrypted: bool) -> int:
    import zenoh

    from gateway.bus.router import LatestStates
    from gateway.bus.silent_connections import SilentConnections, raise_open_files
    from gateway.daemon.runtime.stop_request import StopRequest
    from gateway.errors import InputError

    listen = ", ".join(endpoints)
    stopping = StopRequest()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    try:
        session = zenoh.open(zenoh.Config.from_json5(json.dumps(configuration)))
    except zenoh.ZError as error:
        reason = str(error).split(" at ", 1)[0].strip()
        raise InputError(
            f"{listen}: the router cannot listen there ({reason}); choose another --listen, or check the files"
        ) from error
    states = LatestStates(session)
    states.start()
    print(f"routing at {listen}, {'mutual TLS' if encrypted else 'not encrypted'}", flush=True)
    raise_open_files()
    silent = SilentConnections(endpoints)
    while not stopping.wait(LINK_POLL_S):  # a signal that another thread receives does not end a wait without a limit
        with suppress(zenoh.ZError):
            silent.end_excess(session)
    closing = threading.Thread(target=_close, args=(states, session), daemon=True)
    closing.start()
    closing.join(CLOSE_S)
    return 0


def _close(states: "LatestStates", session: "zenoh.Session") -> None:
    states.close()
    session.close()


def _tls(arguments: argparse.Namespace) -> "TlsFiles | None":
    from gateway.bus.session import TlsFiles
    from gateway.errors import InputError

    files = {name: getattr(arguments, name) for name in ("ca", "certificate", "key")}
    given = [path for path in files.values() if path is not None]
    if not given:
        if arguments.gateways is not None or arguments.reader or arguments.load_signal:
            raise InputError(
                "--gateways, --reader and --load-signal name certificates; give --ca, --certificate and --key too"
            )
        return None
    if missing := [f"--{name}" for name, path in files.items() if path is None]:
        raise InputError(f"mutual TLS needs --ca, --certificate and --key; {' and '.join(missing)} missing")
    if unreadable := [path for path in given if not path.is_file()]:
        raise InputError(f"{unreadable[0]}: no such file; plumbline keys makes certificates")
    return TlsFiles(**files)


def _check_exposure(listen: list[str], has_certificates: bool, allowed: bool) -> None:
    from gateway.configuration.bus_section import check_endpoint, is_encrypted, is_loopback
    from gateway.errors import InputError

    for endpoint in listen:
        try:
            check_endpoint(endpoint)
        except ValueError as error:
            raise InputError(f"--listen: {error}") from error
        if is_encrypted(endpoint) and not has_certificates:
            raise InputError(f"{endpoint} needs --ca, --certificate and --key; plumbline keys makes them")
        if not (is_encrypted(endpoint) or is_loopback(endpoint) or allowed):
            raise InputError(
                f"{endpoint} is open to the network without certificates; listen on tls/..., or add --allow-unencrypted"
            )
