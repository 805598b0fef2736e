"""Naive consumers: each looks at the angle alone, and takes it for what it says."""

import asyncio
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from gateway.bridge.modbus_server import NOT_KNOWN
from gateway.bridge.plant_snapshot import STATE_CODES
from tests.gateway.bridge.modbus_client import ModbusClient
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.mosquitto import Mosquitto, Subscriber
from tests.system.opcua_site import client_uri, issue

ANSWER_S = 1.0
"""Time-out of a controller's request."""


class ModbusPlant:
    """Polls the register of the angle; a controller that gets no answer knows that it has none."""

    protocol = "modbus"

    def __init__(self, _folder: Path) -> None:
        self.port = unused_port()
        self.settings = f'[modbus]\nlisten = "127.0.0.1:{self.port}"\nmax_connections = 24\n'

    def _read(self, register: int) -> int | None:
        with suppress(OSError, EOFError), ModbusClient(self.port, ANSWER_S) as client:
            return client.read(register, 1)[0]
        return None

    def angle_deg(self) -> float | None:
        register = self._read(6)
        return None if register in (None, NOT_KNOWN) else register / 100

    def state(self) -> str | None:
        number = self._read(1)
        return next((word for word, code in STATE_CODES.items() if code.number == number), None)

    def age_s(self) -> float:
        return (self._read(3) or 0) / 1000

    def close(self) -> None:
        """Nothing is held."""


class MqttPlant:
    """Holds the last state that it got; MQTT 3.1.1, whose states do not expire."""

    protocol = "mqtt"

    def __init__(self, folder: Path) -> None:
        self.broker = Mosquitto(folder)
        self._subscriber = Subscriber(self.broker.port, "plumbline/#", version="3.1.1")
        position = folder / "position.json"
        self.settings = f'[mqtt]\nport = {self.broker.port}\nversion = "3.1.1"\nposition_file = "{position}"\n'

    def _last(self) -> dict[str, Any]:
        return self._subscriber.last("/state") or {}

    def angle_deg(self) -> float | None:
        return self._last().get("angle_deg")

    def state(self) -> str | None:
        return self._last().get("state")

    def age_s(self) -> float:
        return (self._last().get("age_ms") or 0) / 1000

    def close(self) -> None:
        """End subscriber and broker."""
        self._subscriber.close()
        self.broker.stop()


class OpcuaSite:
    """The certificates of a server and of clients, of which the server trusts one, and its settings."""

    def __init__(self, folder: Path) -> None:
        self.keys, self.trusted, password = folder / "keys", folder / "trusted", folder / "opcua-password"
        self.server, _ = issue(self.keys, "server")
        for name in ("scada", "stranger"):
            issue(self.keys, name)
        self.trusted.mkdir()
        self.trust("scada")
        password.write_text("secret\n")
        port = unused_port()
        self.url = f"opc.tcp://127.0.0.1:{port}/plumbline"
        self.settings = (
            f'[opcua]\nlisten = "127.0.0.1:{port}"\ncertificate = "{self.server}"\nkey = "{self.keys}/server-key.pem"\n'
            f'trusted = "{self.trusted}"\nuser = "ann"\npassword_file = "{password}"\nmax_connections = 24\n'
        )

    def trust(self, name: str) -> None:
        """Put the certificate of an application into the folder, in place of those that are there."""
        for each in self.trusted.iterdir():
            each.unlink()
        shutil.copy(self.keys / f"{name}.der", self.trusted)

    async def connect(
        self, name: str = "scada", user: str | None = "ann", password: str = "secret", timeout_s: float = 10
    ) -> Client:
        """Connect with the certificate of an application, and as a user; None: without a name."""
        client = Client(self.url, timeout=timeout_s)
        client.application_uri = client_uri(name)
        files = (str(self.keys / f"{name}.der"), str(self.keys / f"{name}-key.pem"))
        await client.set_security(SecurityPolicyBasic256Sha256, *files, server_certificate=str(self.server))
        if user is not None:
            client.set_user(user)
            client.set_password(password)
        await client.connect()
        return client


async def read_node(client: Client, name: str) -> ua.DataValue:
    """The value of a node, whatever its status."""
    index = await client.get_namespace_index("urn:plumbline:bridge")
    node = client.get_node(ua.NodeId(f"{KEY.removeprefix('plumbline/v1/')}/{name}", index))
    return await node.read_data_value(raise_on_bad_status=False)


class OpcuaPlant:
    """Reads the value of a node; a client that gets no answer knows that it has none."""

    protocol = "opcua"

    def __init__(self, folder: Path) -> None:
        self.site = OpcuaSite(folder)
        self.settings = self.site.settings
        self._runner = asyncio.Runner()
        self._client: Client | None = None

    def _read(self, name: str) -> Any:
        try:
            return self._runner.run(self._ask(name))
        except (OSError, TimeoutError, ua.UaError):
            self._leave()
            return None

    async def _ask(self, name: str) -> Any:
        if self._client is None:
            self._client = await self.site.connect(timeout_s=3 * ANSWER_S)
        found = await asyncio.wait_for(read_node(self._client, name), ANSWER_S)
        return found.Value.Value if found.Value is not None else None

    def _leave(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.disconnect_socket()  # a server that hangs answers no farewell

    def angle_deg(self) -> float | None:
        angle_deg = self._read("angle_deg")
        return None if angle_deg is None else float(angle_deg)

    def state(self) -> str | None:
        number = self._read("state")
        return next((word for word, code in STATE_CODES.items() if code.number == number), None)

    def close(self) -> None:
        """Disconnect."""
        self._leave()
        self._runner.close()
