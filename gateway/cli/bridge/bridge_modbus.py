"""`plumbline bridge modbus`: the values of a gateway as registers of Modbus TCP."""

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.cli.bridge.bridge_options import add_bridge_options, run_bridge

if TYPE_CHECKING:
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.settings import BridgeSettings


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "modbus",
        help="serve the values to programmable controllers by Modbus TCP",
        description="Serve the values of one gateway as input registers of Modbus TCP, read-only, until Ctrl-C. "
        "docs/reference/plant_values.md has the register map.",
        epilog="example: plumbline bridge modbus --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    )
    add_bridge_options(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    return run_bridge(arguments, _serve, lambda settings: f"serving Modbus TCP at {settings.modbus.listen}")


async def _serve(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.modbus.modbus_server import ModbusServer

    await ModbusServer(settings.modbus, reader.snapshot).serve(started)
