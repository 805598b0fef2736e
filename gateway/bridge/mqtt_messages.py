"""What an MQTT broker gets: topics and payloads; the changes of alerts one at a time, each noted when it is taken. No clock."""

import json
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from gateway.bridge.plant_snapshot import LEVEL_CODES, STATE_CODES, UNHEARD, PlantSnapshot
from gateway.bridge.plant_values import PLANT_VALUES
from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.alert_sequence import AlertEvent
from gateway.topics import KEY_PREFIX, encode

DIGITS = 4
"""Decimals of a value. Basis: a choice; a hundredth of the smallest uncertainty of an angle."""
EXPIRE_AFTER_S = 2
"""A state that is not renewed is void after this time. Basis: whole seconds, and several times the interval of publishing."""
MOST_WAITING = 256
"""Changes that wait for the broker. Basis: a choice; an hour of a busy crane. Then the gateway keeps the others, and they are
fetched later."""


@dataclass(frozen=True, slots=True)
class MqttTopics:
    """The topics of one gateway."""

    prefix: str
    key: str
    """`plumbline/v1/<site>/<crane>/<sensor>`."""

    @property
    def place(self) -> str:
        """Site, crane and sensor."""
        return self.key.removeprefix(KEY_PREFIX)

    @property
    def state(self) -> str:
        """The state, retained; void when it is not renewed, and replaced by the broker when the bridge is gone."""
        return f"{self.prefix}/{self.place}/state"

    @property
    def alert(self) -> str:
        """The changes of alerts, not retained."""
        return f"{self.prefix}/{self.place}/alert"


def encode_state(snapshot: PlantSnapshot) -> bytes:
    """Return the values as JSON; null: not known."""
    values = {value.name: _stated(value.read(snapshot), value.number(snapshot)) for value in PLANT_VALUES}
    sample_time = snapshot.sample_time
    return json.dumps(
        {
            **values,
            "available": snapshot.state not in UNHEARD,
            "boot_id": snapshot.boot_id,
            "sample_utc": None if sample_time is None else sample_time.isoformat(timespec="milliseconds"),
        }
    ).encode()


def _stated(value: float | int | str | None, number: float | int | None) -> float | int | str | None:
    """Return words as words, and numbers within their range."""
    if isinstance(value, str):
        return value
    return round(number, DIGITS) if isinstance(number, float) else number


def encode_alert(event: AlertEvent) -> bytes:
    """Return a change as the message of the bus, marked where it is not authenticated, or the numbers of lost ones."""
    if event.change is not None and event.doubt is not None:
        return json.dumps(json.loads(encode(event.change)) | {"not_authenticated": event.doubt.text}).encode()
    if event.change is not None:
        return encode(event.change)
    missed = event.missed
    return json.dumps({"missed": None if missed is None else {"first": missed.first, "last": missed.last}}).encode()


STATE, BATTERY = "state", "battery_percent"
SHOWN: dict[str, tuple[str, dict[str, object]]] = {
    "angle_deg": (
        "Angle",
        {"unit_of_measurement": "°", "suggested_display_precision": 1, "state_class": "measurement"},
    ),
    "angle_u95_deg": (
        "Angle, half of the 95 % interval",
        {"unit_of_measurement": "°", "suggested_display_precision": 1, "entity_category": "diagnostic"},
    ),
    "level": ("Level", {"device_class": "enum", "options": list(LEVEL_CODES)}),
    STATE: ("State", {"device_class": "enum", "options": list(STATE_CODES)}),
    BATTERY: ("Battery", {"unit_of_measurement": "%", "device_class": "battery"}),
    "calibration_age_days": (
        "Calibration age",
        {"unit_of_measurement": "d", "device_class": "duration", "suggested_display_precision": 0},
    ),
}
"""Names and kinds of the entities in Home Assistant, by value. Definition: its MQTT discovery."""


NODE_NAMES = {"/": "_-", "_": "__", ".": "_d"}
"""How Home Assistant, which knows letters, digits, '_' and '-', is told the rest, so that no two gateways have one id."""


def discovery(topics: MqttTopics, prefix: str, *, has_battery: bool) -> dict[str, bytes]:
    """Return the retained messages by which Home Assistant finds the entities, by topic; a wired sensor has no battery."""
    node = "plumbline_" + "".join(NODE_NAMES.get(each, each) for each in topics.place)
    device = {"identifiers": [topics.key], "name": topics.place, "manufacturer": "Plumbline"}
    found = {}
    for name, (title, kind) in SHOWN.items():
        if name == BATTERY and not has_battery:
            continue
        entity = {
            "name": title,
            "unique_id": f"{topics.key}/{name}",
            "state_topic": topics.state,
            "value_template": f"{{{{ value_json.{name} }}}}",
            "expire_after": EXPIRE_AFTER_S,
            "device": device,
            **kind,
        }
        if name != STATE:  # it says why the others are not available
            entity["availability_topic"] = topics.state
            entity["availability_template"] = "{{ 'online' if value_json.available else 'offline' }}"
        found[f"{prefix}/sensor/{node}/{name}/config"] = json.dumps(entity).encode()
    return found


@dataclass(frozen=True, slots=True)
class WaitingAlert:
    """A change, and the position of the receiver behind it."""

    payload: bytes
    position: str


class AlertDelivery:
    """Takes changes while there is room, and gives out the oldest until it is taken."""

    def __init__(self, receiver: AlertReceiver) -> None:
        self._receiver = receiver
        self._waiting: deque[WaitingAlert] = deque()

    def receive(self, timeout_s: float) -> None:
        """Wait for changes, a time at most. What does not fit any more is not asked for."""
        if len(self._waiting) < MOST_WAITING:
            self._waiting.extend(self._changes(timeout_s))

    def _changes(self, timeout_s: float) -> Iterator[WaitingAlert]:
        for event in self._receiver.poll(timeout_s):
            if event.state is None:
                yield WaitingAlert(encode_alert(event), self._receiver.states_json)

    @property
    def oldest(self) -> WaitingAlert | None:
        """The change that comes next."""
        return self._waiting[0] if self._waiting else None

    def taken(self) -> str:
        """Note that the broker has the oldest change; return the position from which to go on after a restart."""
        return self._waiting.popleft().position
