"""Naive consumers: each looks at the angle alone, and takes it for what it says."""

from contextlib import suppress

from gateway.bridge.modbus.registers import NOT_KNOWN
from gateway.bridge.plant_state import STATE_CODES
from tests.gateway.bridge.modbus_client import ModbusClient
from tests.ports import unused_port

ANSWER_S = 1.0
"""Time-out of a controller's request."""


class ModbusPlant:
    """Polls the register of the angle; a controller that gets no answer knows that it has none."""

    protocol = "modbus"

    def __init__(self) -> None:
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
