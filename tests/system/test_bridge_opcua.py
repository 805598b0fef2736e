"""The OPC UA bridge: its information model, who may connect, and alerts as events.

The client is of the library that the server is built with, so that it is no independent party.
"""

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, Node, ua

from gateway.bridge.opcua_values import SEVERITY
from gateway.bridge.plant_values import PLANT_VALUES
from tests.system.conftest import BusPeer, StartGateway
from tests.system.plant_clients import OpcuaSite, read_node
from tests.system.running_bridge import RunningBridge
from tests.system.test_alert_delivery import CHATTERING
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

LOOK_S = 0.3
"""Between two looks of a client that takes all conditions anew for each."""
REFRESH = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh)
REFRESH_OF_ONE = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh2)


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


async def gateway_node(client: Client) -> Node:
    """The object of the gateway, below which its values are."""
    index = await client.get_namespace_index("urn:plumbline:bridge")
    (node,) = [each for each in await client.nodes.objects.get_children() if each.nodeid.NamespaceIndex == index]
    return node


async def check_model(client: Client) -> None:
    """Every value has its node, with unit and range, and cannot be written."""
    index = await client.get_namespace_index("urn:plumbline:bridge")
    crane = await gateway_node(client)
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
    site.trust("stranger")  # the folder counts at each new link
    await (await site.connect("stranger")).disconnect()
    with pytest.raises((ua.UaStatusCodeError, ua.UaError)):
        await site.connect()
    site.trust("scada")


def serve(bridge: RunningBridge, consuming: Coroutine[None, None, None]) -> str:
    """Let a client consume what a bridge serves, and stop the bridge; return what it has logged."""
    try:
        asyncio.run(asyncio.wait_for(consuming, 2 * PATIENCE_S))
        code, err = bridge.stop()
    finally:
        bridge.end()
    assert (code, "Traceback" in err) == (0, False), err
    return err


async def check_events(client: Client, start_again: Callable[[], object]) -> None:
    """A gateway that starts again states its levels as changes of alerts, at its own node and at the server's."""
    crane = await gateway_node(client)
    kind = await alert_type(client)
    events, everywhere = Events(), Events()
    subscription = await client.create_subscription(50, events)
    await subscription.subscribe_events(crane, kind)
    of_server = await client.create_subscription(50, everywhere)
    await of_server.subscribe_events(ua.ObjectIds.Server, kind)
    start_again()
    await until(lambda: len(events.taken) >= 2 and len(everywhere.taken) >= 2, "events")
    first = events.taken[0]
    assert first.ConditionName in ("swing", "lean")
    assert (first.AlertNumber > 0, bool(first.BootId), first.Severity) == (True, True, SEVERITY[first.Level])
    both = {each.EventId for each in everywhere.taken[:2]}
    await until(lambda: both <= {each.EventId for each in events.taken}, "the same events at both nodes")
    await subscription.delete()
    await of_server.delete()


async def alert_type(client: Client) -> Any:
    index = await client.get_namespace_index("urn:plumbline:bridge")
    return await client.nodes.base_event_type.get_child(
        ["0:ConditionType", "0:AcknowledgeableConditionType", "0:AlarmConditionType", f"{index}:PlumblineAlertType"]
    )


async def refresh(client: Client, *, is_of_one_item: bool = False) -> list[Any]:
    """What a client gets that has just subscribed, here at both nodes, and asks for the conditions that stand."""
    events, condition_type = Events(), client.get_node(ua.ObjectIds.ConditionType)
    subscription = await client.create_subscription(50, events)
    brackets = [ua.ObjectIds.RefreshStartEventType, ua.ObjectIds.RefreshEndEventType]
    crane = await gateway_node(client)
    kinds = [await alert_type(client), *brackets]
    items = [await subscription.subscribe_events(node, kinds) for node in (ua.ObjectIds.Server, crane)]
    numbers = [ua.Variant(number, ua.VariantType.UInt32) for number in (subscription.subscription_id, items[1])]
    method = REFRESH_OF_ONE if is_of_one_item else REFRESH
    await condition_type.call_method(method, *numbers[: 1 + is_of_one_item])
    ends = 1 if is_of_one_item else len(items)
    end = ua.NodeId(brackets[1])
    await until(lambda: [each.EventType for each in events.taken].count(end) == ends, "the end of the refresh")
    await subscription.delete()
    assert events.taken[0].EventType == ua.NodeId(brackets[0])
    assert events.taken[-1].EventType == end
    return [each for each in events.taken if each.EventType == kinds[0].nodeid]


async def check_commands_are_refused(client: Client, alarm: Any) -> None:
    """Nobody acknowledges through a bridge, and clients can see it before they try."""
    for method in (ua.ObjectIds.AcknowledgeableConditionType_Acknowledge, ua.ObjectIds.ConditionType_Disable):
        node = client.get_node(method)
        assert (await node.read_attribute(ua.AttributeIds.UserExecutable)).Value.Value is False
        for condition in (alarm.NodeId, ua.NodeId(ua.ObjectIds.ConditionType)):
            comment = [alarm.EventId, ua.LocalizedText("seen")]
            with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
                await client.get_node(condition).call_method(node, *comment)


async def check_unknown_numbers(client: Client) -> None:
    """A refresh of what is not there says so."""
    events = Events()
    subscription = await client.create_subscription(50, events)
    known, unknown = (ua.Variant(each, ua.VariantType.UInt32) for each in (subscription.subscription_id, 10_000))
    for method, numbers, code in (
        (REFRESH, [unknown], "BadSubscriptionIdInvalid"),
        (REFRESH_OF_ONE, [unknown, unknown], "BadSubscriptionIdInvalid"),
        (REFRESH_OF_ONE, [known, unknown], "BadMonitoredItemIdInvalid"),
    ):
        with pytest.raises(ua.UaStatusCodeError, match=code):
            await client.get_node(ua.ObjectIds.ConditionType).call_method(method, *numbers)
    await subscription.delete()


def test_a_client_that_joins_while_an_alarm_stands_gets_it_by_a_refresh(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    site, settings = OpcuaSite(tmp_path), tmp_path / "bridge.toml"
    settings.write_text("demonstration = true\n" + site.settings)
    stays = CHATTERING.replace("7.2", "0.2").replace("hold_s = 0", "hold_s = 600")
    gateway = start_gateway(stays)
    peer = BusPeer(gateway.endpoint)
    raised = peer.wait_for("alert", lambda alert: alert["level"] == "trip")
    peer.wait_for("alert", lambda alert: alert["event"] == "standing" and alert["level"] == "trip")
    peer.close()
    bridge = RunningBridge("opcua", gateway.endpoint, settings)  # which has not heard the change

    async def consume() -> None:
        first, late = await site.connect(), await site.connect()
        async with asyncio.timeout(PATIENCE_S):
            while not (found := await refresh(first)):
                await asyncio.sleep(LOOK_S)
        again = await refresh(late)
        alarm, same = [each for each in again if each.ConditionName == "swing"]
        assert alarm.EventId == same.EventId
        (once,) = [each for each in await refresh(late, is_of_one_item=True) if each.ConditionName == "swing"]
        assert once.EventId == alarm.EventId
        assert (alarm.Level, alarm.Severity, alarm.Retain, alarm.BootId) == ("trip", 900, True, raised["boot_id"])
        assert getattr(alarm, "ActiveState/Id") is True
        assert alarm.NodeId.Identifier.endswith("/alarm/swing")
        assert alarm.EventId == next(each for each in found if each.ConditionName == "swing").EventId
        assert alarm.Quality.is_good()
        await check_commands_are_refused(late, alarm)
        gateway.process.kill()
        async with asyncio.timeout(PATIENCE_S):
            while (await refresh(late))[0].Quality.is_good():
                await asyncio.sleep(LOOK_S)
        await check_unknown_numbers(late)
        await first.disconnect()
        await late.disconnect()

    serve(bridge, consume())


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

    err = serve(bridge, consume())
    assert "a client is refused: CN=stranger, BadCertificateUntrusted" in err
    assert "a user is refused: ann" in err
