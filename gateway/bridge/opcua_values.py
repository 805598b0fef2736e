"""What OPC UA shows: values with units and status codes; alerts as conditions, with what stands for clients that join late."""

import uuid
from copy import copy
from datetime import UTC, datetime
from typing import Any

from asyncua import Server, ua, uamethod
from asyncua.common.node import Node
from asyncua.server.event_generator import EventGenerator

from gateway.bridge.plant_snapshot import STATED, UNHEARD, PlantSnapshot, PlantState
from gateway.bridge.plant_values import PlantValue
from gateway.bus.alert_sequence import AlertEvent
from gateway.bus.authenticity import Doubt
from gateway.messages import Alert, Level
from gateway.pipeline.alert_rules import RULE_NAMES

NAMESPACE = "urn:plumbline:bridge"
UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
UNITS = {
    "deg": ("DD", "°"),
    "s": ("SEC", "s"),
    "ms": ("C26", "ms"),
    "d": ("DAY", "d"),
    "%": ("P1", "%"),
    "V": ("VLT", "V"),
}
"""Code and sign of a unit. Definition: UNECE Recommendation 20."""
STATUS: dict[PlantState, int] = {
    PlantState.NO_DATA: ua.StatusCodes.BadWaitingForInitialData,
    PlantState.FINE: ua.StatusCodes.BadNoData,
    PlantState.NOT_KNOWN: ua.StatusCodes.BadDataUnavailable,
    PlantState.UNCALIBRATED: ua.StatusCodes.BadConfigurationError,
    PlantState.SUSPENDED: ua.StatusCodes.BadOutOfService,
    PlantState.SENSOR_GONE: ua.StatusCodes.BadSensorFailure,
    PlantState.STALE: ua.StatusCodes.BadNoCommunication,
    PlantState.GATEWAY_GONE: ua.StatusCodes.BadDeviceFailure,
    PlantState.LINK_GONE: ua.StatusCodes.BadNotConnected,
    PlantState.SIMULATED: ua.StatusCodes.BadNotSupported,
    PlantState.REPLAY: ua.StatusCodes.BadNotSupported,
    PlantState.DUPLICATE: ua.StatusCodes.BadConfigurationError,
    PlantState.BRIDGE_GONE: ua.StatusCodes.BadShutdown,
    PlantState.NOT_AUTHENTICATED: ua.StatusCodes.BadSecurityChecksFailed,
}
"""Why a value is not known; in a fine state: there is none, such as a coming peak of a load at rest."""
SEVERITY: dict[Level, int] = {"trip": 900, "warn": 600, "unknown": 400, "normal": 100}
"""Definition: OPC 10000-5, section 6.4.2: 1 to 1000, from 667 on high."""
MOST_CONDITIONS = 16
"""Conditions of one gateway. Basis: a choice; several times the rules, and a bound for names that somebody invents."""


def is_measured(value: PlantValue) -> bool:
    """Return whether a value has a fraction; others are counts and codes."""
    return value.float_register is not None


def variant_type(value: PlantValue) -> ua.VariantType:
    """Return the type of a value's node."""
    return ua.VariantType.Double if is_measured(value) else ua.VariantType.UInt32


def data_value(value: PlantValue, snapshot: PlantSnapshot) -> ua.DataValue:
    """Return a value with its status and the time of its sample; without a number where it is not known."""
    number, time = value.number(snapshot), snapshot.sample_time
    if number is None:
        return ua.DataValue(ua.Variant(), ua.StatusCode(STATUS[snapshot.state]), SourceTimestamp=time)
    simulated = is_measured(value) and snapshot.source in ("simulated", "replay")
    status = ua.StatusCodes.UncertainSimulatedValue if simulated else ua.StatusCodes.Good
    exact = float(number) if is_measured(value) else int(number)
    return ua.DataValue(ua.Variant(exact, variant_type(value)), ua.StatusCode(status), SourceTimestamp=time)


def engineering_unit(unit: str) -> ua.EUInformation:
    """Return a unit as OPC UA describes it."""
    code, sign = UNITS[unit]
    return ua.EUInformation(
        NamespaceUri=UNECE,
        UnitId=int.from_bytes(code.encode(), "big"),
        DisplayName=ua.LocalizedText(sign),
        Description=ua.LocalizedText(unit),
    )


class OpcuaAlerts:
    """A condition for each rule, sent from the node of the gateway and, as most clients expect, from that of the server."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._places: tuple[ua.NodeId, ua.NodeId] = (ua.NodeId(), ua.NodeId())
        self._generators: dict[str, EventGenerator] = {}
        self._standing: dict[str, Any] = {}
        """The last event of each condition that stands, by rule."""
        self._quality = ua.StatusCode(ua.StatusCodes.Good)
        self._brackets: list[Any] = []
        """The events at the begin and the end of a refresh."""

    async def build(self, crane: Node, index: int, name: str) -> None:
        """Make the type of the events and the conditions of the known rules; answer the method of condition refresh."""
        server, self._index, self._name = self._server, index, name
        self._places = (crane.nodeid, server.nodes.server.nodeid)
        self._kind = await server.create_custom_event_type(
            index,
            "PlumblineAlertType",
            ua.ObjectIds.AlarmConditionType,
            [
                ("AlertNumber", ua.VariantType.UInt32),
                ("BootId", ua.VariantType.String),
                ("Level", ua.VariantType.String),
            ],
        )
        for rule in RULE_NAMES:
            await self._add(rule)
        for kind in (ua.ObjectIds.RefreshStartEventType, ua.ObjectIds.RefreshEndEventType):
            self._brackets.append((await server.get_event_generator(kind)).event)
        for method in (ua.ObjectIds.ConditionType_ConditionRefresh, ua.ObjectIds.ConditionType_ConditionRefresh2):
            server.link_method(server.get_node(method), uamethod(self._refresh))

    async def take(self, event: AlertEvent) -> None:
        """Send a change; those who are not subscribed now do not get it. With a state, follow the alerts that stand."""
        if event.change is not None and event.change.rule is not None:
            await self._send(event.change, event.change.rule, event.change.change or event.change.text, event.doubt)
        if event.state is not None:
            state = STATED[event.state]
            self._quality = ua.StatusCode(STATUS[state] if state in UNHEARD else ua.StatusCodes.Good)
            if event.standing is not None and state not in UNHEARD:
                await self._follow(event.standing, event.doubt)

    async def _follow(self, standing: Alert, doubt: Doubt | None) -> None:
        """Send what stands and was not sent, as after a start, and the end of what stands no longer: its change was lost."""
        active = {each.rule: each for each in standing.active}
        for rule in (*(active.keys() - self._standing.keys()), *self._standing):
            now = active.get(rule)
            if rule not in self._standing or now is None or now.level != self._standing[rule].Level:
                await self._send(standing, rule, standing.text if now is None else now.text, doubt)

    async def _add(self, rule: str) -> EventGenerator:
        generator = await self._server.get_event_generator(self._kind, self._places[0])
        generator.event.NodeId = ua.NodeId(f"{self._name}/alarm/{rule}", self._index)
        generator.event.ConditionName = rule
        _set_state(generator.event, "EnabledState", ("Disabled", "Enabled"), is_true=True)
        self._generators[rule] = generator
        return generator

    async def _send(self, alert: Alert, rule: str, text: str, doubt: Doubt | None) -> None:
        """Send the condition of a rule as an alert states it."""
        generator = self._generators.get(rule)
        if generator is None and len(self._generators) < MOST_CONDITIONS:
            generator = await self._add(rule)
        if generator is None:
            return
        active = next((each for each in alert.active if each.rule == rule), None)
        level: Level = "normal" if active is None else active.level
        event = generator.event
        event.Severity, event.Retain, event.Level = SEVERITY[level], level != "normal", level
        event.AlertNumber, event.BootId = alert.alert_number or 0, alert.boot_id or ""
        event.Quality = self._quality
        _set_state(event, "ActiveState", ("Inactive", "Active"), is_true=level != "normal")
        is_acknowledged = active is not None and active.acknowledged_by is not None
        _set_state(event, "AckedState", ("Unacknowledged", "Acknowledged"), is_true=is_acknowledged)
        await generator.trigger(message=text if doubt is None else f"{doubt}: {text}")
        if event.Retain:
            self._standing[rule] = copy(event)
        else:
            self._standing.pop(rule, None)
        await self._server.iserver.subscription_service.trigger_event(_placed(event, self._places[1]))

    async def _refresh(self, _parent: ua.NodeId, subscription: int, item: int | None = None) -> ua.StatusCode | None:
        """Send what stands to a subscription, or to one item of it (OPC 10000-9, sections 5.5.7 and 5.5.8)."""
        found = self._server.iserver.subscription_service.subscriptions.get(subscription)
        if found is None:
            return ua.StatusCode(ua.StatusCodes.BadSubscriptionIdInvalid)
        service = found.monitored_item_srv
        items = [
            (place, each)
            for place in self._places
            for each in service._monitored_events.get(place, ())
            if item in (None, each)
        ]
        if item is not None and not items:
            return ua.StatusCode(ua.StatusCodes.BadMonitoredItemIdInvalid)
        begin, end = (_stamped(event) for event in self._brackets)
        for event in self._standing.values():
            event.Quality = self._quality
        for event in (begin, *self._standing.values(), end):
            for place, each in items:
                await service.trigger_event(_placed(event, place), each)
        return None


def _placed(event: Any, place: ua.NodeId) -> Any:
    """Return an event as it is, to be sent from a node."""
    placed = copy(event)
    placed.emitting_node = place
    return placed


def _stamped(event: Any) -> Any:
    """Return an event of now."""
    stamped = copy(event)
    stamped.EventId = ua.Variant(uuid.uuid4().bytes, ua.VariantType.ByteString)
    stamped.Time = stamped.ReceiveTime = datetime.now(UTC)
    return stamped


def _set_state(event: Any, name: str, words: tuple[str, str], *, is_true: bool) -> None:
    """Set a state of two values, and the word for it."""
    setattr(event, name, ua.LocalizedText(words[is_true]))
    setattr(event, f"{name}/Id", is_true)
