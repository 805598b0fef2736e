"""What every section of the configuration has in common, and the address of a server: how it is read and written."""

import re
from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict

from gateway.errors import pattern_of

NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
"""One of the three names in the key of a gateway."""
KEY_PATTERN = pattern_of(f"^{NAME}$", "letters, digits, '.', '_' and '-', and begin with a letter or a digit")
MAX_PORT = 65535


class Section(BaseModel):
    """A table of the file. Unknown keys are refused, and values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def one_of(values: Iterable[str | int]) -> Any:
    """Return the type of a key that has one of these values: a literal that follows from a table."""
    return Literal[tuple(values)]


def host_and_port(address: str) -> tuple[str, int]:
    """Return the parts of an address such as 127.0.0.1:8321 or [::1]:8321. Raises `ValueError` for anything else."""
    host, _, port = address.rpartition(":")
    if not re.fullmatch(r"[^:\s]+|\[[^\s]+\]", host) or not re.fullmatch(r"[0-9]{1,5}", port):
        raise ValueError(f"{address} is not an address with a port, such as 127.0.0.1:8321")
    if int(port) > MAX_PORT:
        raise ValueError(f"{address}: a port is a number of 0 (any that is free) to {MAX_PORT}")
    return host.strip("[]"), int(port)


def written(host: str, port: int) -> str:
    """Return an address as in a URL."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _check_address(address: str) -> str:
    host_and_port(address)
    return address


Address = Annotated[str, AfterValidator(_check_address)]
