"""`plumbline bridge`: the values of a gateway for a plant, by one protocol for each process.

All bridges have the same options and the same life: one gateway, the settings, and an end by a signal.
"""

import argparse
import asyncio
import logging
import signal
import sys
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.bus_link import CONNECT_OPTIONS, client_credentials, connect_endpoint
from gateway.cli.command import command, option
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.settings import BridgeSettings
    from gateway.service_state import ServiceNotifier

ALIVE_S = 0.25
"""Time between two signs of life to the service manager. Basis: a sixth of the unit's patience, `WatchdogSec`."""
Serve = Callable[["BridgeSettings", "GatewayReader", Callable[[], None]], Coroutine[None, None, None]]
"""Serves with settings and a reader until cancelled, and says when it has begun."""


BRIDGE_OPTIONS = [
    option(
        "--settings",
        type=Path,
        metavar="FILE",
        help="settings of the bridges (TOML); config/bridge.toml is an example",
    ),
    option(
        "--gateway",
        metavar="KEY",
        help="plumbline/v1/<site>/<crane>/<sensor> (default: the gateway that is installed on this machine)",
    ),
    *CONNECT_OPTIONS,
]


@command(
    "mqtt",
    "publish the values and the alerts to an MQTT broker",
    "Publish the values of one gateway as retained states to an MQTT broker, and each change of an alert once "
    "and in order, until Ctrl-C.",
    "example: plumbline bridge mqtt --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    *BRIDGE_OPTIONS,
)
def run_mqtt(arguments: argparse.Namespace) -> int:
    """Publish to an MQTT broker."""
    require_extra("mqtt")
    return _run_bridge(
        arguments, _serve_mqtt, lambda settings: f"bridge to the MQTT broker {settings.mqtt.host}:{settings.mqtt.port}"
    )


async def _serve_mqtt(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.mqtt_messages import AlertDelivery, MqttTopics
    from gateway.bridge.mqtt_publisher import MqttPublisher, read_position

    section = settings.mqtt
    alerts = AlertDelivery(reader.receive_alerts(read_position(section.position_file)))
    publisher = MqttPublisher(section, MqttTopics(section.prefix, reader.key), reader.snapshot, alerts)
    started()
    try:
        while True:
            publisher.step()
            await asyncio.sleep(0)  # the signals of the process are looked at
    finally:
        publisher.close()


@command(
    "modbus",
    "serve the values to programmable controllers by Modbus TCP",
    "Serve the values of one gateway as input registers of Modbus TCP, read-only, until Ctrl-C. "
    "docs/reference/plant_values.md has the register map.",
    "example: plumbline bridge modbus --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    *BRIDGE_OPTIONS,
)
def run_modbus(arguments: argparse.Namespace) -> int:
    """Serve by Modbus TCP."""
    return _run_bridge(arguments, _serve_modbus, lambda settings: f"serving Modbus TCP at {settings.modbus.listen}")


async def _serve_modbus(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.modbus_server import ModbusServer

    await ModbusServer(settings.modbus, reader.snapshot).serve(started)


@command(
    "opcua",
    "serve the values and the alerts to control systems by OPC UA",
    "Serve the values of one gateway as nodes of OPC UA, and its alerts as events, until Ctrl-C. Links are "
    "encrypted, and nobody is served without a name.",
    "example: plumbline bridge opcua --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    *BRIDGE_OPTIONS,
)
def run_opcua(arguments: argparse.Namespace) -> int:
    """Serve by OPC UA."""
    require_extra("opcua")
    return _run_bridge(arguments, _serve_opcua, lambda settings: f"serving OPC UA at {settings.opcua.listen}")


async def _serve_opcua(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.opcua_server import OpcuaServer

    for library in ("asyncua", "asyncuagds"):  # they log each connection, and a trace for each that is refused
        logging.getLogger(library).setLevel(logging.CRITICAL)
    alerts = reader.receive_alerts("{}")
    await OpcuaServer(settings.opcua, reader.key, reader.snapshot, alerts).serve(started)


@command(
    "foxglove",
    "serve the live topics to viewers by the Foxglove WebSocket protocol",
    "Serve the live topics of one gateway, with the names and schemas of its recordings, to Foxglove, Lichtblick "
    "and other viewers on this machine, until Ctrl-C.",
    "example: plumbline bridge foxglove --gateway plumbline/v1/yard/crane-1/hook",
    *BRIDGE_OPTIONS,
)
def run_foxglove(arguments: argparse.Namespace) -> int:
    """Serve viewers."""
    require_extra("foxglove")
    from gateway.bridge.foxglove_server import LIVE_TOPICS, LiveMessages
    from gateway.recording.format.content import encode_recorded, schema_bytes

    messages = LiveMessages(encode_recorded)

    async def serve(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
        from gateway.bridge.foxglove_server import FoxgloveServer

        await FoxgloveServer(settings.foxglove, reader.key, schema_bytes, reader.snapshot, messages).serve(started)

    return _run_bridge(
        arguments,
        serve,
        lambda settings: f"serving Foxglove viewers at ws://{settings.foxglove.listen}",
        inbox=messages,
        topics=LIVE_TOPICS,
    )


def _gateway_key(arguments: argparse.Namespace) -> str:
    """Return the key of the one gateway. Raises `InputError`."""
    from gateway.bus.untrusted import GATEWAY_KEY
    from gateway.configuration.loading import is_installed, load_installed
    from gateway.errors import InputError

    if arguments.gateway is None and not is_installed():
        raise InputError("name the gateway: --gateway plumbline/v1/<site>/<crane>/<sensor>")
    key = load_installed().gateway.key if arguments.gateway is None else str(arguments.gateway)
    if GATEWAY_KEY.fullmatch(key) is None:
        raise InputError(f"--gateway {key}: a bridge has one gateway, plumbline/v1/<site>/<crane>/<sensor>")
    return key


def _run_bridge(
    arguments: argparse.Namespace, serve: Serve, description: Callable[["BridgeSettings"], str], **heard: Any
) -> int:
    """Serve until SIGINT or SIGTERM; print what is served when it has begun. `heard`: `inbox` and `topics` of the reader."""
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.heard_messages import HeardMessages
    from gateway.bridge.settings import load_settings
    from gateway.service_state import ServiceNotifier

    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    settings, key = load_settings(arguments.settings), _gateway_key(arguments)
    messages = HeardMessages(key, demonstration=settings.demonstration, allow_unsigned=settings.allow_unsigned)
    reader = GatewayReader(connect_endpoint(arguments), key, client_credentials(arguments), messages, **heard)
    notifier = ServiceNotifier()
    running: set[asyncio.Task[None]] = set()

    def announce() -> None:
        print(f"{description(settings)}, of {key}", flush=True)
        notifier.send("READY=1")
        running.add(asyncio.get_running_loop().create_task(_show_life(notifier)))

    try:
        asyncio.run(_until_signal(serve(settings, reader, announce)))
    except BaseException:
        reader.close()
        raise
    return 0


async def _until_signal(serving: Coroutine[None, None, None]) -> None:
    task, loop = asyncio.ensure_future(serving), asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, task.cancel)
    with suppress(asyncio.CancelledError):
        await task


async def _show_life(notifier: "ServiceNotifier") -> None:
    """Tell the service manager again and again that the loop turns, in which all is served."""
    while True:
        notifier.send("WATCHDOG=1")
        await asyncio.sleep(ALIVE_S)
