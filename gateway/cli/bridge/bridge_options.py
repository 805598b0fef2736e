"""The options and the life of every bridge: its gateway, its settings, and its end by a signal."""

import argparse
import asyncio
import logging
import os
import signal
import sys
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.options.bus_link import add_connect, client_credentials, connect_endpoint

if TYPE_CHECKING:
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.settings import BridgeSettings
    from gateway.service_state import ServiceNotifier

ALIVE_S = 0.25
"""Time between two signs of life to the service manager. Basis: a sixth of the unit's patience, `WatchdogSec`."""
Serve = Callable[["BridgeSettings", "GatewayReader", Callable[[], None]], Coroutine[None, None, None]]
"""Serves with settings and a reader until cancelled, and says when it has begun."""


def add_bridge_options(verb: argparse.ArgumentParser) -> None:
    """Add `--settings`, `--gateway`, `--connect` and `--credentials`."""
    verb.add_argument(
        "--settings", type=Path, metavar="FILE", help="settings of the bridges (TOML); config/bridge.toml is an example"
    )
    verb.add_argument(
        "--gateway",
        metavar="KEY",
        help="plumbline/v1/<site>/<crane>/<sensor> (default: the gateway that is installed on this machine)",
    )
    add_connect(verb)


def gateway_key(arguments: argparse.Namespace) -> str:
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


def run_bridge(
    arguments: argparse.Namespace, serve: Serve, description: Callable[["BridgeSettings"], str], **heard: Any
) -> int:
    """Serve until SIGINT or SIGTERM; print what is served when it has begun. `heard`: `inbox` and `topics` of the reader."""
    from gateway.bridge.gateway_reader import GatewayReader
    from gateway.bridge.heard_messages import HeardMessages
    from gateway.bridge.settings import load_settings
    from gateway.service_state import ServiceNotifier

    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    settings, key = load_settings(arguments.settings), gateway_key(arguments)
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
    sys.stdout.flush()
    os._exit(0)  # a thread of the bus that does not end would hold the process; there is nothing to save


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
