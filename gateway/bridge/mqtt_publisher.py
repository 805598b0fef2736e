"""The publisher to an MQTT broker: the state retained, each change of an alert once and in order, Home Assistant's discovery.

The broker may be away, slow or unwilling at any time: nothing waits for it, and nothing piles up. The library's thread connects,
sends and calls back; the callbacks only note what has happened.
"""

import logging
import ssl
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from paho.mqtt.client import Client, ConnectFlags, DisconnectFlags, MQTTv5, MQTTv311
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from gateway.atomic_io import write_durably
from gateway.bridge.mqtt_messages import EXPIRE_AFTER_S, AlertDelivery, MqttTopics, discovery, encode_state
from gateway.bridge.plant_snapshot import BRIDGE_GONE, PlantSnapshot, PlantState
from gateway.bridge.settings import MqttSection, read_password
from gateway.bus.heard_gateway import read_states
from gateway.errors import InputError
from gateway.file_input import reason_of

log = logging.getLogger("plumbline.mqtt")
STEP_S = 0.05
"""Longest wait before the state is looked at again. Basis: a choice; half the time between two readings."""
BUSY_STEP_S = 0.005
"""The same while the broker has a change to take. Basis: a choice; a broker answers in milliseconds."""
KEEP_ALIVE_S = 1
"""A broker that hears nothing for one and a half times this publishes the will. Definition: the smallest of MQTT."""
RETRY_S = (1, 10)
"""Shortest and longest pause between two attempts to connect. Basis: a choice; a restart of a broker is over soon."""
REFUSED_PAUSE_S = 5.0
"""Pause before a change that the broker has refused is sent again. Basis: a choice; rights are changed by people."""
MOST_QUEUED = 64
"""Messages that the library keeps until the broker has taken them. Basis: a choice; those of some reconnections."""
EARLY_S = 5.0
"""A connection that ends within this time has not ended by chance. Basis: a choice; two clients of one name take turns each
second."""
LAST_WORD_S = 1.0
"""Longest wait at the end for the broker to take the last state. Basis: a choice; the will says the same later."""
FIRST_REFUSAL = 128
"""Definition: MQTT 5, section 2.4, reason codes from this one on are refusals."""


class MqttPublisher:
    """Publishes what is known of a gateway. `step` is called again and again by one thread."""

    def __init__(
        self,
        section: MqttSection,
        topics: MqttTopics,
        snapshot: Callable[[], PlantSnapshot],
        alerts: AlertDelivery,
    ) -> None:
        """Begin to connect. Raises `InputError` for files that cannot be used."""
        self._section, self._topics, self._snapshot, self._alerts = section, topics, snapshot, alerts
        self._is_v5 = section.version == "5"
        self._connected = self._greet = self._has_battery = False
        self._connected_s = float("-inf")
        self._acknowledged: dict[int, ReasonCode] = {}
        """What the broker has answered to a message, by its number."""
        self._awaited: dict[int, str] = {}
        """Topics of the messages that it has not answered yet, by their number."""
        self._refused: set[str] = set()
        """Topics that it has refused since it was connected last."""
        self._lock = threading.Lock()
        self._sent: int | None = None
        """Number of the change that the broker has not answered yet."""
        self._retry_s = self._published_s = float("-inf")
        self._published: tuple[object, ...] = ()
        self._complaint: str | None = None
        """What the log has said of the broker since it was connected last."""
        self._client = self._make_client()
        self._client.connect_async(section.host, section.port, KEEP_ALIVE_S, **self._session())
        self._client.loop_start()

    def step(self) -> None:
        """Pass on what has come, and publish the state where it is due."""
        self._alerts.receive(STEP_S if self._alerts.oldest is None or not self._connected else BUSY_STEP_S)
        if self._connected:
            if self._greet:
                self._greet = False
                self._introduce()
            self._deliver(time.monotonic())
            self._publish_state(time.monotonic())

    def close(self) -> None:
        """Say that the bridge is gone, as the broker would, and leave."""
        if self._connected:
            last = self._put(self._topics.state, encode_state(BRIDGE_GONE), qos=1)
            end_s = time.monotonic() + LAST_WORD_S
            while last not in self._acknowledged and time.monotonic() < end_s:
                time.sleep(BUSY_STEP_S)
        self._client.on_disconnect = None  # it is no failure
        self._client.disconnect()
        self._client.loop_stop()

    def _make_client(self) -> Client:
        section = self._section
        client = Client(CallbackAPIVersion.VERSION2, self._name, protocol=MQTTv5 if self._is_v5 else MQTTv311)
        if section.user is not None:
            client.username_pw_set(section.user, read_password(section.password_file, "mqtt.password_file"))
        if section.ca is not None:
            try:
                client.tls_set(str(section.ca), _text(section.certificate), _text(section.key))
            except (OSError, ValueError) as error:
                raise InputError(f"mqtt.ca, certificate and key cannot be used: {error}") from error
        client.will_set(self._topics.state, encode_state(BRIDGE_GONE), qos=1, retain=True)
        client.max_queued_messages_set(MOST_QUEUED)
        client.reconnect_delay_set(*RETRY_S)
        client.on_connect_fail = self._on_connect_fail
        client.on_connect, client.on_disconnect, client.on_publish = (
            self._on_connect,
            self._on_disconnect,
            self._on_publish,
        )
        return client

    @property
    def _name(self) -> str:
        return self._section.client_id or "plumbline-" + self._topics.place.replace("/", "-")

    def _session(self) -> dict[str, Any]:
        return {"clean_start": True} if self._is_v5 else {}

    def _on_connect(
        self, _client: Client, _data: object, _flags: ConnectFlags, reason: ReasonCode, _properties: Properties | None
    ) -> None:
        if reason.is_failure:
            self._complain(f"refuses the connection: {reason}")
        else:
            self._complaint = None
            log.info("connected to %s:%d", self._section.host, self._section.port)
            self._connected_s = time.monotonic()
            self._connected = self._greet = True

    def _on_connect_fail(self, _client: Client, _data: object) -> None:
        """Say why: the library calls this while it handles the exception, and gives no reason."""
        match sys.exception():
            case ssl.SSLCertVerificationError() as error:
                self._complain(
                    f"has a certificate that is not taken: {error.verify_message}; look at mqtt.ca and mqtt.host"
                )
            case ssl.SSLError() as error:
                self._complain(f"does not agree on TLS ({error.reason}); look at mqtt.port and mqtt.ca")
            case Exception() as error:
                self._complain(f"cannot be reached: {reason_of(error)}; look at mqtt.host and mqtt.port")
            case _:
                self._complain("cannot be reached; look at mqtt.host and mqtt.port")

    def _on_disconnect(
        self,
        _client: Client,
        _data: object,
        _flags: DisconnectFlags,
        reason: ReasonCode,
        _properties: Properties | None,
    ) -> None:
        if self._complaint is None:
            self._complain(f"has ended the connection{self._guess()}: {reason}")
        self._connected = False

    def _guess(self) -> str:
        """Return what usually ends a connection so early, where the broker does not say it."""
        section = self._section
        if not self._connected and section.ca is None:
            return " before the sign-in (does it want TLS, and so mqtt.ca?)"
        if not self._connected:
            return " before the sign-in (does it want a certificate of this client, mqtt.certificate?)"
        if time.monotonic() - self._connected_s < EARLY_S:
            return f" at once (is there another client with the id {self._name}? mqtt.client_id gives this one another)"
        return ""

    def _complain(self, what: str) -> None:
        """Log what is wrong, once until it is something else."""
        if what != self._complaint:
            log.warning("%s:%d %s", self._section.host, self._section.port, what)
        self._complaint = what

    def _on_publish(
        self, _client: Client, _data: object, number: int, reason: ReasonCode, _properties: Properties | None
    ) -> None:
        with self._lock:
            self._acknowledged[number] = reason

    def _introduce(self) -> None:
        """Publish what a broker that has lost its memory needs. A refusal of the first state shows in the log."""
        self._refused.clear()
        self._put(self._topics.state, encode_state(PlantSnapshot(state=PlantState.NO_DATA)), qos=1)
        self._announce()
        self._published_s = float("-inf")

    def _announce(self) -> None:
        """Let Home Assistant find the entities."""
        if self._section.home_assistant is not None:
            found = discovery(self._topics, self._section.home_assistant, has_battery=self._has_battery)
            for topic, payload in found.items():
                self._put(topic, payload, qos=1, expires=False)

    def _deliver(self, now_s: float) -> None:
        """Send the oldest change, and note it when the broker has taken it: at most one is on its way, so that none overtakes."""
        with self._lock:
            answers, self._acknowledged = self._acknowledged, {}
        refused = [number for number, reason in answers.items() if reason.value >= FIRST_REFUSAL]
        for number, reason in answers.items():
            topic = self._awaited.pop(number, "")
            if number in refused and topic not in self._refused:
                self._refused.add(topic)
                log.error("the broker refuses %s: %s; does its ACL let this client write?", topic, reason)
        if self._sent in answers:
            is_taken, self._sent = self._sent not in refused, None
            if is_taken:
                self._remember(self._alerts.taken())
            else:
                self._retry_s = now_s + REFUSED_PAUSE_S
        oldest = self._alerts.oldest
        if oldest is not None and self._sent is None and now_s >= self._retry_s:
            self._sent = self._put(self._topics.alert, oldest.payload, qos=1, retain=False)

    def _remember(self, position: str) -> None:
        try:
            write_durably(self._section.position_file, position.encode())
        except OSError as error:
            log.error("%s: %s; alerts are sent again after a restart", self._section.position_file, error.strerror)

    def _publish_state(self, now_s: float) -> None:
        """Publish a new state at once and a new reading when it is due; not while the broker takes nothing."""
        snapshot = self._snapshot()
        if snapshot.battery_percent is not None and not self._has_battery:
            self._has_battery = True
            self._announce()
        word = (snapshot.state, snapshot.level, snapshot.active_alerts, snapshot.alert_number)
        is_due = now_s - self._published_s >= self._section.interval_s
        if (is_due or word != self._published) and not self._client.want_write():
            self._put(self._topics.state, encode_state(snapshot), qos=0)
            self._published, self._published_s = word, now_s

    def _put(self, topic: str, payload: bytes, qos: int, *, retain: bool = True, expires: bool = True) -> int | None:
        """Hand a message to the library; return its number, None where there is no room."""
        properties = None
        if self._is_v5:
            properties = Properties(PacketTypes.PUBLISH)
            if retain and expires:
                properties.MessageExpiryInterval = EXPIRE_AFTER_S
        info = self._client.publish(topic, payload, qos, retain, properties)
        if info.rc == MQTTErrorCode.MQTT_ERR_QUEUE_SIZE:
            return None
        if qos:
            self._awaited[info.mid] = topic
        return info.mid


def read_position(path: Path) -> str:
    """Return the position of the last run, as a receiver of alerts takes it. Raises `InputError`."""
    if not path.absolute().parent.is_dir():
        raise InputError(f"mqtt.position_file: {path.parent} is no folder; make it, or name a file in another one")
    read_states(path, "{}")
    return path.read_text() if path.exists() else "{}"


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
