"""The settings of the bridges: a file of their own, so that the gateway never reads the passwords and keys of other servers."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, ValidationError

from gateway.configuration.section import Section
from gateway.errors import InputError, describe_problems
from gateway.file_input import MAX_TOML_BYTES, parse_toml, read_bounded, reason_of


def _check_address(text: str) -> str:
    host, _, port = text.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal()) or not 0 < int(port) < 65_536:
        raise ValueError("an address has the form 127.0.0.1:5020")
    return text


Address = Annotated[str, AfterValidator(_check_address)]


def host_and_port(address: str) -> tuple[str, int]:
    """Return the parts of an address."""
    host, _, port = address.rpartition(":")
    return host.strip("[]"), int(port)


class ModbusSection(Section):
    """The server of Modbus TCP, which anybody may read who reaches it."""

    listen: Address = Field("127.0.0.1:5020", description="where to serve; default: only this machine")
    max_connections: int = Field(8, ge=1, le=64, description="connections at the same time; further ones are closed")
    idle_s: float = Field(30, gt=0, le=3600, description="a connection without a request is closed after this time")


class BridgeSettings(Section):
    """The whole file."""

    demonstration: bool = Field(
        False, description="states the values of a simulated crane or a recording as if a sensor had measured them"
    )
    modbus: ModbusSection = ModbusSection()


def load_settings(path: Path | None) -> BridgeSettings:
    """Return the settings of a file, or the defaults. Raises `InputError`."""
    if path is None:
        return BridgeSettings()
    try:
        return BridgeSettings.model_validate(parse_toml(read_bounded(path, MAX_TOML_BYTES).decode()))
    except ValidationError as error:
        raise InputError(f"{path}: " + "; ".join(describe_problems(error))) from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {reason_of(error)}; config/bridge.toml is an example") from error
