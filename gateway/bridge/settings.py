"""The settings of the bridges: a file of their own, so that the gateway never reads the passwords and keys of other servers."""

from collections.abc import Mapping
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ValidationError, field_validator, model_validator

from gateway.configuration.bus_section import is_loopback
from gateway.configuration.loading import suggest
from gateway.configuration.section import Address, Section
from gateway.errors import InputError, describe_problem
from gateway.file_input import read_toml, reason_of


def _check_network(text: str) -> str:
    ip_network(text)  # its error names the text
    return text


Network = Annotated[str, AfterValidator(_check_network)]
TopicPrefix = Annotated[str, Field(pattern=r"^[^/+#$\s][^+#\s]*$", max_length=100)]


class ModbusSection(Section):
    """The server of Modbus TCP, which knows no passwords."""

    listen: Address = Field("127.0.0.1:5020", description="where to serve; default: only this machine")
    clients: list[Network] | None = Field(
        None, description="addresses and networks that may connect, such as 10.0.0.7 and 10.0.1.0/24; default: all"
    )
    max_connections: int = Field(8, ge=1, le=64, description="connections at the same time; further ones are closed")
    idle_s: float = Field(30, gt=0, le=3600, description="a connection without a request is closed after this time")


class MqttSection(Section):
    """The broker, and how to sign in there."""

    host: str = Field("127.0.0.1", min_length=1, description="name or address of the broker")
    port: int = Field(1883, ge=1, le=65_535, description="1883, with TLS 8883")
    version: Literal["5", "3.1.1"] = Field("5", description="of MQTT; states expire with 5 alone")
    client_id: str | None = Field(None, max_length=200, description="default: plumbline-<site>-<crane>-<sensor>")
    user: str | None = Field(None, description="name of the user")
    password_file: Path | None = Field(None, description="file with the password of the user, and nothing else")
    ca: Path | None = Field(None, description="certificate of the CA that has issued the broker's: switches TLS on")
    certificate: Path | None = Field(None, description="certificate of this client, where the broker asks for one")
    key: Path | None = Field(None, description="its private key")
    allow_unencrypted: bool = Field(False, description="reach a broker on another machine without TLS")
    prefix: TopicPrefix = Field("plumbline", description="first part of the topics")
    home_assistant: TopicPrefix | None = Field(
        None, description="prefix of Home Assistant's discovery, usually homeassistant; default: none"
    )
    interval_s: float = Field(
        0.25, ge=0.1, le=1, description="time between two states where nothing changes but numbers"
    )
    position_file: Path = Field(
        Path("mqtt-position.json"), description="remembers the last alert that the broker has taken"
    )

    @model_validator(mode="after")
    def _check_security(self) -> Self:
        if (self.certificate is None) != (self.key is None) or (self.key is not None and self.ca is None):
            raise ValueError("certificate and key belong together, and need ca")
        if self.password_file is not None and self.user is None:
            raise ValueError("password_file needs user")
        if self.ca is None and not self.allow_unencrypted and not is_loopback(f"tcp/{self.host}:{self.port}"):
            raise ValueError(f"{self.host} is reached without TLS; set ca, or allow_unencrypted = true")
        return self


class OpcuaSection(Section):
    """The server of OPC UA, which takes encrypted links alone."""

    listen: Address = Field("127.0.0.1:4840", description="where to serve; default: only this machine")
    certificate: Path | None = Field(None, description="certificate of this server, with an RSA key; needed")
    key: Path | None = Field(None, description="its private key; needed")
    trusted: Path | None = Field(None, description="folder with certificates of the clients, or of their CA; needed")
    revoked: Path | None = Field(None, description="folder with revocation lists")
    user: str | None = Field(None, min_length=1, description="name of a user; others sign in by a trusted certificate")
    password_file: Path | None = Field(None, description="file with the password of the user, and nothing else")
    max_connections: int = Field(16, ge=1, le=100, description="connections at the same time; further ones are closed")

    @model_validator(mode="after")
    def _check_user(self) -> Self:
        if (self.user is None) != (self.password_file is None):
            raise ValueError("user and password_file belong together")
        return self


class FoxgloveSection(Section):
    """The server for viewers, on this machine alone: its library knows no sign-in."""

    listen: Address = Field("127.0.0.1:8765", description="where to serve; on this machine")

    @field_validator("listen")
    @classmethod
    def _check_loopback(cls, listen: str) -> str:
        if not is_loopback(f"tcp/{listen}"):
            raise ValueError(
                f"{listen} is open to others, and the protocol's library knows no tokens; use a tunnel (ssh -L)"
            )
        return listen


class BridgeSettings(Section):
    """The whole file."""

    demonstration: bool = Field(
        False, description="states the values of a simulated crane or a recording as if a sensor had measured them"
    )
    allow_unsigned: bool = Field(
        False, description="states the values of a gateway that has no key: whoever reaches its bus can forge them"
    )
    modbus: ModbusSection = ModbusSection()
    mqtt: MqttSection = MqttSection()
    opcua: OpcuaSection = OpcuaSection()
    foxglove: FoxgloveSection = FoxgloveSection()


def load_settings(path: Path | None) -> BridgeSettings:
    """Return the settings of a file, or the defaults. Raises `InputError`."""
    if path is None:
        return BridgeSettings()
    try:
        return BridgeSettings.model_validate(read_toml(path))
    except ValidationError as error:
        raise InputError(f"{path}: " + "; ".join(map(_describe, error.errors(include_url=False)))) from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {reason_of(error)}; config/bridge.toml is an example") from error


def _describe(problem: Mapping[str, Any]) -> str:
    """Return the place of a problem, what is wrong, and for an unknown key what was probably meant."""
    place = problem["loc"]
    name = ".".join(map(str, place)) or "content"
    if problem["type"] != "extra_forbidden":
        return f"{name}: {describe_problem(problem)}"
    section = BridgeSettings if len(place) == 1 else type(getattr(BridgeSettings(), place[0]))
    return f"{name}: unknown key{suggest(place[-1], section.model_fields)}"


def cannot_listen(setting: str, address: str, error: OSError) -> InputError:
    """Return the error of an address that cannot be used, with the system's reason alone: asyncio repeats the address in it."""
    return InputError(f"{address} cannot be used ({str(error.strerror).rpartition(': ')[2]}); change {setting}")


def read_password(path: Path | None, key: str) -> str | None:
    """Return the password in a file; `key` names it in the settings. Raises `InputError`."""
    try:
        return None if path is None else path.read_text().rstrip("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{key}: {path}: cannot be read") from error
