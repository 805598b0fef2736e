"""`plumbline bridge opcua`: the values and alerts of a gateway as nodes and events of OPC UA."""

import argparse
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.cli.bridge.bridge_options import add_bridge_options, run_bridge
from gateway.cli.options.argument_types import require_extra

if TYPE_CHECKING:
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.settings import BridgeSettings


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "opcua",
        help="serve the values and the alerts to control systems by OPC UA",
        description="Serve the values of one gateway as nodes of OPC UA, and its alerts as events, until Ctrl-C. Links are "
        "encrypted, and nobody is served without a name.",
        epilog="example: plumbline bridge opcua --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    )
    add_bridge_options(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_extra("opcua")
    return run_bridge(arguments, _serve, lambda settings: f"serving OPC UA at {settings.opcua.listen}")


async def _serve(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.opcua.opcua_server import OpcuaServer

    for library in ("asyncua", "asyncuagds"):  # they log each connection, and a trace for each that is refused
        logging.getLogger(library).setLevel(logging.CRITICAL)
    alerts = reader.receive_alerts("{}")
    await OpcuaServer(settings.opcua, reader.key, reader.snapshot, alerts).serve(started)
