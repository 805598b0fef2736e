"""The OPC UA bridge: its information model, who may connect, and alerts as events.

The client is of the library that the server is built with, so that it is no independent party.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua

from gateway.bridge.plant_values import PLANT_VALUES
from tests.system.conftest import StartGateway
from tests.system.plant_clients import OpcuaSite, read_node
from tests.system.running_bridge import RunningBridge
from tests.system.test_alert_delivery import CHATTERING
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow


class Events:
    """Takes the events of a subscription."""

    def __init__(self) -> None:
        self.taken: list[Any] = []

    def event_notification(self, event: Any) -> None:
        self.taken.append(event)


async def until(condition: Callable[[], Any], what: str) -> None:
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                await asyncio.sleep(0.05)
    except TimeoutError:
        pytest.fail(f"waited in vain for {what}")


async def check_model(client: Client) -> None:
    """Every value has its node, with unit and range, and cannot be written."""
    index = await client.get_namespace_index("urn:plumbline:bridge")
    (crane,) = [node for node in await client.nodes.objects.get_children() if node.nodeid.NamespaceIndex == index]
    names = [(await node.read_browse_name()).Name for node in await crane.get_variables()]
    assert sorted(names) == sorted(value.name for value in PLANT_VALUES)
    angle = await crane.get_child(f"{index}:angle_deg")
    unit = await (await angle.get_child("0:EngineeringUnits")).read_value()
    span = await (await angle.get_child("0:EURange")).read_value()
    assert (unit.UnitId, unit.DisplayName.Text, span.Low, span.High) == (17476, "°", 0.0, 180.0)
    words = await (await (await crane.get_child(f"{index}:level")).get_child("0:EnumStrings")).read_value()
    assert [word.Text for word in words] == ["unknown", "normal", "warn", "trip"]
    with pytest.raises(ua.UaStatusCodeError):
        await angle.write_value(1.0)


async def check_refusals(site: OpcuaSite) -> None:
    """Neither a stranger's certificate, nor a wrong password, nor no name, nor an open link is taken."""
    for arguments in ({"name": "stranger"}, {"password": "wrong"}, {"user": None}):
        with pytest.raises((ua.UaStatusCodeError, ua.UaError)):
            await site.connect(**arguments)
    with pytest.raises(ua.UaError, match="No matching endpoints"):
        await Client(site.url).connect()


async def check_events(client: Client, start_again: Callable[[], object]) -> None:
    """A gateway that starts again states its levels as changes of alerts."""
    index = await client.get_namespace_index("urn:plumbline:bridge")
    (crane,) = [node for node in await client.nodes.objects.get_children() if node.nodeid.NamespaceIndex == index]
    kind = await client.nodes.base_event_type.get_child(
        ["0:ConditionType", "0:AcknowledgeableConditionType", "0:AlarmConditionType", f"{index}:PlumblineAlertType"]
    )
    events = Events()
    subscription = await client.create_subscription(50, events)
    await subscription.subscribe_events(crane, kind)
    start_again()
    await until(lambda: len(events.taken) >= 2, "events")
    first = events.taken[0]
    assert first.ConditionName in ("swing", "lean")
    assert (first.AlertNumber > 0, bool(first.BootId), first.Level in ("unknown", "normal")) == (True, True, True)
    await subscription.delete()


def test_named_users_of_trusted_applications_read_values_and_get_alerts(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    site = OpcuaSite(tmp_path)
    settings = tmp_path / "bridge.toml"
    settings.write_text("demonstration = true\n" + site.settings)
    gateway = start_gateway(CHATTERING)
    bridge = RunningBridge("opcua", gateway.endpoint, settings)

    def start_again() -> None:
        gateway.process.kill()
        gateway.wait()
        start_gateway(CHATTERING, environment={"PLUMBLINE_BUS__LISTEN": f'["{gateway.endpoint}"]'})

    async def consume() -> None:
        client = await site.connect()
        found: list[ua.DataValue] = []
        while not found or found[-1].Value is None or found[-1].Value.Value is None:
            found.append(await read_node(client, "angle_deg"))
            await asyncio.sleep(0.05)
        assert found[-1].StatusCode.name == "UncertainSimulatedValue"
        assert found[-1].SourceTimestamp is not None
        battery = await read_node(client, "battery_v")
        assert (battery.Value.Value, battery.StatusCode.name) == (None, "BadNoData")
        await check_model(client)
        await check_refusals(site)
        await check_events(client, start_again)
        await client.disconnect()

    try:
        asyncio.run(asyncio.wait_for(consume(), 2 * PATIENCE_S))
        code, err = bridge.stop()
    finally:
        bridge.end()
    assert (code, "Traceback" in err) == (0, False), err
    assert "a client is refused: CN=stranger, BadCertificateUntrusted" in err
    assert "a user is refused: ann" in err
