"""Mosquitto as Debian packages it, on a port and with files of its own."""

import json
import shutil
import signal
import socket
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from paho.mqtt.client import Client, MQTTMessage, MQTTv5, MQTTv311
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from tests.ports import unused_port
from tests.waiting import wait_until

HOUR_S = 3600
USUAL_PLACE = "/usr/sbin/mosquitto"


class Mosquitto:
    """A broker that can be stopped, started again, and held."""

    def __init__(self, folder: Path, *settings: str, listener: str = "", anonymous: bool = True) -> None:
        program = shutil.which("mosquitto") or (USUAL_PLACE if Path(USUAL_PLACE).exists() else None)
        if program is None:
            pytest.fail(
                "mosquitto is missing: the MQTT bridge cannot be tested; mend: apt install mosquitto", pytrace=False
            )
        self._program = program
        self.port = unused_port()
        store = folder / "mosquitto"
        store.mkdir()
        self._file = folder / "mosquitto.conf"
        lines = [
            f"listener {self.port} 127.0.0.1",
            *listener.splitlines(),
            f"allow_anonymous {str(anonymous).lower()}",
            "persistence true",
            f"persistence_location {store}/",
            "log_dest none",
            "user root",  # where root runs the tests: another user could not read their files
            *settings,
        ]
        self._file.write_text("\n".join(lines) + "\n")
        self.start()

    def start(self) -> None:
        command = [self._program, "-c", str(self._file)]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_until(self._listens, "the broker")

    def _listens(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def signal(self, what: signal.Signals) -> None:
        self.process.send_signal(what)

    def stop(self) -> None:
        """End it as its service does: it stores what waits for its subscribers."""
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait()


class Subscriber:
    """A consumer that keeps its session while the broker is away, and all that it has got."""

    def __init__(
        self, port: int, topic: str, *, version: str = "5", prepare: Callable[[Client], object] = lambda _: None
    ) -> None:
        self.messages: list[tuple[str, Any, bool]] = []
        """Topic, content, and whether it was retained."""
        self._news = threading.Lock()
        v5 = version == "5"
        name = f"subscriber-{id(self)}"
        self._client = (
            Client(CallbackAPIVersion.VERSION2, name, protocol=MQTTv5)
            if v5
            else Client(CallbackAPIVersion.VERSION2, name, clean_session=False, protocol=MQTTv311)
        )
        prepare(self._client)
        self._client.on_message = self._take
        self._client.on_connect = lambda client, *_: client.subscribe(topic, 1)
        self._client.reconnect_delay_set(1, 1)
        session: dict[str, Any] = {}
        if v5:
            properties = Properties(PacketTypes.CONNECT)
            properties.SessionExpiryInterval = HOUR_S
            session = {"clean_start": False, "properties": properties}
        self._client.connect_async("127.0.0.1", port, 10, **session)
        self._client.loop_start()

    def _take(self, _client: Client, _data: object, message: MQTTMessage) -> None:
        with self._news:
            content = json.loads(message.payload) if message.payload else None
            self.messages.append((message.topic, content, message.retain))

    def contents(self, ending: str) -> list[Any]:
        """What has come on topics that end so."""
        with self._news:
            return [content for topic, content, _ in self.messages if topic.endswith(ending)]

    def last(self, ending: str) -> Any:
        found = self.contents(ending)
        return found[-1] if found else None

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
