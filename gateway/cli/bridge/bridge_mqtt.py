"""`plumbline bridge mqtt`: the state and the alerts of a gateway at an MQTT broker."""

import argparse
import asyncio
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
        "mqtt",
        help="publish the values and the alerts to an MQTT broker",
        description="Publish the values of one gateway as retained states to an MQTT broker, and each change of an alert once "
        "and in order, until Ctrl-C.",
        epilog="example: plumbline bridge mqtt --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
    )
    add_bridge_options(verb)
    verb.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    require_extra("mqtt")
    return run_bridge(
        arguments, _serve, lambda settings: f"publishing to MQTT at {settings.mqtt.host}:{settings.mqtt.port}"
    )


async def _serve(settings: "BridgeSettings", reader: "GatewayReader", started: Callable[[], None]) -> None:
    from gateway.bridge.mqtt.alert_delivery import AlertDelivery
    from gateway.bridge.mqtt.mqtt_messages import MqttTopics
    from gateway.bridge.mqtt.mqtt_publisher import MqttPublisher, read_position

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
