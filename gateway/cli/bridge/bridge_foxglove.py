"""`plumbline bridge foxglove`: the live topics of a gateway for Foxglove, Lichtblick and other viewers."""

import argparse
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
        "foxglove",
        help="serve the live topics to viewers by the Foxglove WebSocket protocol",
        description="Serve the live topics of one gateway, with the names and schemas of its recordings, to Foxglove, Lichtblick "
        "and other viewers on this machine, until Ctrl-C.",
        epilog="example: plumbline bridge foxglove --gateway plumbline/v1/yard/crane-1/hook",
    )
    add_bridge_options(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_extra("foxglove")
    from gateway.bridge.foxglove.live_messages import LIVE_TOPICS, LiveMessages
    from gateway.recording.format.encoding import encode_recorded, schema_bytes

    messages = LiveMessages(encode_recorded)

    async def serve(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
        from gateway.bridge.foxglove.foxglove_server import FoxgloveServer

        await FoxgloveServer(settings.foxglove, reader.key, schema_bytes, reader.snapshot, messages).serve(started)

    return run_bridge(
        arguments,
        serve,
        lambda settings: f"serving Foxglove viewers at ws://{settings.foxglove.listen}",
        inbox=messages,
        topics=LIVE_TOPICS,
    )
