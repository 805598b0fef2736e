"""Naive consumers: each looks at the angle alone, and takes it for what it says."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from gateway.bridge.modbus.registers import NOT_KNOWN
from gateway.bridge.plant_state import STATE_CODES
from tests.gateway.bridge.modbus_client import ModbusClient
from tests.ports import unused_port
from tests.system.mosquitto import Mosquitto, Subscriber

ANSWER_S = 1.0
"""Time-out of a controller's request."""


class ModbusPlant:
    """Polls the register of the angle; a controller that gets no answer knows that it has none."""

    protocol = "modbus"

    def __init__(self, _folder: Path) -> None:
        self._port = unused_port()
        self.settings = f'[modbus]\nlisten = "127.0.0.1:{self._port}"\n'

    def _read(self, register: int) -> int | None:
        with suppress(OSError, EOFError), ModbusClient(self._port, ANSWER_S) as client:
            return client.read(register, 1)[0]
        return None

    def angle_deg(self) -> float | None:
        register = self._read(6)
        return None if register in (None, NOT_KNOWN) else register / 100

    def state(self) -> str | None:
        number = self._read(1)
        return next((word for word, code in STATE_CODES.items() if code.number == number), None)

    def close(self) -> None:
        """Nothing is held."""


class MqttPlant:
    """Holds the last state that it got; MQTT 3.1.1, whose states do not expire."""

    protocol = "mqtt"

    def __init__(self, folder: Path) -> None:
        self._broker = Mosquitto(folder)
        self._subscriber = Subscriber(self._broker.port, "plumbline/#", version="3.1.1")
        position = folder / "position.json"
        self.settings = f'[mqtt]\nport = {self._broker.port}\nversion = "3.1.1"\nposition_file = "{position}"\n'

    def _last(self) -> dict[str, Any]:
        return self._subscriber.last("/state") or {}

    def angle_deg(self) -> float | None:
        return self._last().get("angle_deg")

    def state(self) -> str | None:
        return self._last().get("state")

    def close(self) -> None:
        """End subscriber and broker."""
        self._subscriber.close()
        self._broker.stop()
