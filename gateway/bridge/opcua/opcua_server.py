"""The address space and the life of the OPC UA server."""

import asyncio
from collections.abc import Callable

from asyncua import Server, ua
from asyncua.common.instantiate_util import instantiate
from asyncua.common.node import Node
from asyncua.server.event_generator import EventGenerator
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession

from gateway.bridge.opcua.opcua_security import PlantUsers, secure, trust_store
from gateway.bridge.opcua.opcua_values import NAMESPACE, data_value, engineering_unit, is_measured
from gateway.bridge.plant_snapshot import BRIDGE_GONE, PlantSnapshot
from gateway.bridge.plant_state import PlantState
from gateway.bridge.plant_values import PLANT_VALUES, PlantValue
from gateway.bridge.settings import OpcuaSection, host_and_port, read_password
from gateway.bus.alert_event import AlertEvent
from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.authenticity import Doubt
from gateway.errors import InputError
from gateway.messages import Alert, Level

STEP_S = 0.1
"""Time between two looks at the state. Basis: a choice; readings come ten times a second."""
LONGEST_MESSAGE = 1 << 20
"""Longest message of a client, bytes. Basis: a choice; the library's default is 100 MB, and a client only reads here."""
SEVERITY: dict[Level, int] = {"trip": 900, "warn": 600, "unknown": 400, "normal": 100}
"""Definition: OPC 10000-5, section 6.4.2: 1 to 1000, from 667 on high."""
START = PlantSnapshot(state=PlantState.NO_DATA)


class OpcuaServer:
    """Writes what is known into its nodes, and sends changes of alerts as events."""

    def __init__(
        self, section: OpcuaSection, key: str, snapshot: Callable[[], PlantSnapshot], alerts: AlertReceiver
    ) -> None:
        self._section, self._key, self._snapshot, self._alerts = section, key, snapshot, alerts
        self._nodes: list[tuple[PlantValue, ua.NodeId]] = []
        self._written: list[ua.DataValue] = []
        self._events: EventGenerator | None = None

    async def serve(self, started: Callable[[], None]) -> None:
        """Serve until cancelled; `started` is called when clients can connect. Raises `InputError`."""
        section, trusted = self._section, trust_store(self._section)
        password = read_password(section.password_file, "opcua.password_file")
        internal = InternalServer(user_manager=PlantUsers(section.user, password, trusted))
        internal.max_connections = InternalSession.max_connections = section.max_connections
        server = Server(internal)
        server.limits.max_message_size = LONGEST_MESSAGE
        await server.init()
        server.set_server_name("Plumbline bridge")
        host, port = host_and_port(section.listen)
        server.set_endpoint(f"opc.tcp://{host}:{port}/plumbline")
        await secure(server, section, trusted)
        await self._build(server)
        try:
            await server.start()
        except OSError as error:
            raise InputError(f"{section.listen} cannot be used ({error.strerror}); change opcua.listen") from error
        started()
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._write_states(server))
                tasks.create_task(self._send_alerts())
        finally:
            await self._write(server, BRIDGE_GONE)
            await server.stop()

    async def _build(self, server: Server) -> None:
        """Make the nodes: an object for the gateway, below it a variable for each value."""
        index = await server.register_namespace(NAMESPACE)
        name = self._key.removeprefix("plumbline/v1/")
        crane = await server.nodes.objects.add_object(ua.NodeId(name, index), ua.QualifiedName(name, index))
        for value in PLANT_VALUES:
            node = await _add_value(server, crane, index, name, value)
            self._nodes.append((value, node.nodeid))
        self._written = [ua.DataValue()] * len(self._nodes)
        kind = await server.create_custom_event_type(
            index,
            "PlumblineAlertType",
            ua.ObjectIds.AlarmConditionType,
            [
                ("AlertNumber", ua.VariantType.UInt32),
                ("BootId", ua.VariantType.String),
                ("Level", ua.VariantType.String),
            ],
        )
        self._events = await server.get_event_generator(kind, crane)
        await self._write(server, START)

    async def _write_states(self, server: Server) -> None:
        while True:
            await self._write(server, self._snapshot())
            await asyncio.sleep(STEP_S)

    async def _write(self, server: Server, snapshot: PlantSnapshot) -> None:
        for place, (value, node) in enumerate(self._nodes):
            wanted = data_value(value, snapshot)
            if wanted != self._written[place]:
                self._written[place] = wanted
                await server.write_attribute_value(node, wanted)

    async def _send_alerts(self) -> None:
        while True:
            for event in await asyncio.to_thread(self._poll):
                if event.change is not None:
                    await self._send(event.change, event.doubt)

    def _poll(self) -> list[AlertEvent]:
        return list(self._alerts.poll(STEP_S))

    async def _send(self, change: Alert, doubt: Doubt | None) -> None:
        """Send a change as the event of a condition; those who are not subscribed now do not get it."""
        if self._events is None:
            return
        level: Level = next((each.level for each in change.active if each.rule == change.rule), "normal")
        event = self._events.event
        event.ConditionName, event.Severity, event.Retain = change.rule, SEVERITY[level], level != "normal"
        event.AlertNumber, event.BootId, event.Level = change.alert_number or 0, change.boot_id or "", level
        setattr(event, "ActiveState/Id", level != "normal")
        setattr(event, "AckedState/Id", any(each.acknowledged_by for each in change.active if each.rule == change.rule))
        text = change.change or change.text
        await self._events.trigger(message=text if doubt is None else f"{doubt}: {text}")


async def _add_value(server: Server, crane: Node, index: int, name: str, value: PlantValue) -> Node:
    """Add the variable of a value: analogue with its unit and range, or a state with its words."""
    plain = ua.ObjectIds.BaseDataVariableType if value.codes is None else ua.ObjectIds.MultiStateDiscreteType
    base = server.get_node(ua.ObjectIds.AnalogItemType if value.unit else plain)
    (node, *_) = await instantiate(
        crane,
        base,
        nodeid=ua.NodeId(f"{name}/{value.name}", index),
        bname=ua.QualifiedName(value.name, index),
        dname=ua.LocalizedText(value.name),
        idx=index,
        instantiate_optional=False,
    )
    kind = ua.ObjectIds.Double if is_measured(value) else ua.ObjectIds.UInt32
    await node.write_attribute(
        ua.AttributeIds.DataType, ua.DataValue(ua.Variant(ua.NodeId(kind), ua.VariantType.NodeId))
    )
    await node.write_attribute(ua.AttributeIds.Description, ua.DataValue(ua.Variant(ua.LocalizedText(value.meaning))))
    if value.unit:
        await (await node.get_child("0:EURange")).write_value(ua.Range(Low=float(value.low), High=float(value.high)))
        await node.add_property(
            ua.NodeId(f"{name}/{value.name}/unit", index),
            ua.QualifiedName("EngineeringUnits", 0),
            engineering_unit(value.unit),
        )
    elif value.codes is not None:
        words = [ua.LocalizedText(word) for word in value.codes]
        await (await node.get_child("0:EnumStrings")).write_value(words)
    return node
