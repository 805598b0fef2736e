"""The server of OPC UA: a node for each value with unit and range, and each change of an alert as an event."""

import asyncio
from collections.abc import Callable

from asyncua import Server, ua
from asyncua.common.instantiate_util import instantiate
from asyncua.common.node import Node
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession

from gateway.bridge.opcua_security import COMMANDS, PlantUsers, ReadingMethods, secure, trust_store
from gateway.bridge.opcua_values import NAMESPACE, OpcuaAlerts, data_value, engineering_unit, is_measured
from gateway.bridge.plant_snapshot import BRIDGE_GONE, PlantSnapshot, PlantState
from gateway.bridge.plant_values import PLANT_VALUES, PlantValue
from gateway.bridge.settings import OpcuaSection, cannot_listen, read_password
from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.alert_sequence import AlertEvent
from gateway.configuration.section import host_and_port, written
from gateway.topics import KEY_PREFIX

STEP_S = 0.1
"""Time between two looks at the state. Basis: a choice; readings come ten times a second."""
LONGEST_MESSAGE = 1 << 20
"""Longest message of a client, bytes. Basis: a choice; the library's default is 100 MB, and a client only reads here."""
START = PlantSnapshot(state=PlantState.NO_DATA)


class OpcuaServer:
    """Writes what is known into its nodes, and sends changes of alerts as events."""

    def __init__(
        self, section: OpcuaSection, key: str, snapshot: Callable[[], PlantSnapshot], alerts: AlertReceiver
    ) -> None:
        self._section, self._key, self._snapshot, self._alerts = section, key, snapshot, alerts
        self._nodes: list[tuple[PlantValue, ua.NodeId]] = []
        self._written: list[ua.DataValue] = []

    async def serve(self, started: Callable[[], None]) -> None:
        """Serve until cancelled; `started` is called when clients can connect. Raises `InputError`."""
        section, trusted = self._section, trust_store(self._section)
        password = read_password(section.password_file, "opcua.password_file")
        internal = InternalServer(user_manager=PlantUsers(section.user, password, trusted))
        internal.method_service = ReadingMethods(internal.method_service)
        internal.max_connections = InternalSession.max_connections = section.max_connections
        server = Server(internal)
        server.limits.max_message_size = LONGEST_MESSAGE
        await server.init()
        server.set_server_name("Plumbline bridge")
        host, port = host_and_port(section.listen)
        server.set_endpoint(f"opc.tcp://{written(host, port)}/plumbline")
        await secure(server, section, trusted)
        alarms = await self._build(server)
        try:
            await server.start()
        except OSError as error:
            raise cannot_listen("opcua.listen", section.listen, error) from error
        started()
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._write_states(server))
                tasks.create_task(self._send_alerts(alarms))
        finally:
            await self._write(server, BRIDGE_GONE)
            await server.stop()

    async def _build(self, server: Server) -> OpcuaAlerts:
        """Make the nodes: an object for the gateway, below it a variable for each value; return its alarms."""
        index = await server.register_namespace(NAMESPACE)
        name = self._key.removeprefix(KEY_PREFIX)
        crane = await server.nodes.objects.add_object(ua.NodeId(name, index), ua.QualifiedName(name, index))
        for value in PLANT_VALUES:
            node = await _add_value(server, crane, index, name, value)
            self._nodes.append((value, node.nodeid))
        self._written = [ua.DataValue()] * len(self._nodes)
        for command in COMMANDS:  # clients need not offer it
            is_allowed = ua.DataValue(ua.Variant(False, ua.VariantType.Boolean))
            await server.get_node(command).write_attribute(ua.AttributeIds.UserExecutable, is_allowed)
        alarms = OpcuaAlerts(server)
        await alarms.build(crane, index, name)
        await self._write(server, START)
        return alarms

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

    async def _send_alerts(self, alarms: OpcuaAlerts) -> None:
        while True:
            for event in await asyncio.to_thread(self._poll):
                await alarms.take(event)

    def _poll(self) -> list[AlertEvent]:
        return list(self._alerts.poll(STEP_S))


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
