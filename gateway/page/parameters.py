"""The start parameters of the page process: the first frame of the channel on standard input.

The parent binds the listening socket, so that an occupied port is an error at its own start.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from gateway.errors import describe_problems
from gateway.topics import KEY_PREFIX

Key = Annotated[str, Field(pattern=rf"^{KEY_PREFIX}[^/*$#?]+/[^/*$#?]+/[^/*$#?]+$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CraneDirections:
    """The crane's own words for the directions of the housing's axes."""

    plus_x: str = "+x"
    minus_x: str = "−x"
    plus_y: str = "+y"
    minus_y: str = "−y"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Start parameters of the page process."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    key: Key
    """Zenoh key of the sensor, `plumbline/v1/<site>/<crane>/<sensor>`."""
    warn_deg: Positive
    trip_deg: Positive
    fd: Annotated[int, Field(ge=0)] = 0
    """Number of the inherited listening socket; it is filled in at the start."""
    stale_s: Positive = 1.0
    """A value older than this, beyond the usual interval of its topic, is stale."""
    lean_trip_deg: Positive | None = None
    pin_file: Path | None = None
    """File with the PIN; None: nobody can acknowledge on the page."""
    hosts: list[str] = field(default_factory=list)
    """Names under which browsers may reach the page, beside its address."""
    names: list[str] = field(default_factory=list)
    """Names offered to a person who signs in."""
    title: str = ""
    """Displayed instead of the sensor's name."""
    language: str = "en"
    directions: CraneDirections = CraneDirections()

    @property
    def place(self) -> dict[str, str]:
        """Site, crane and sensor of the key."""
        return dict(zip(("site", "crane", "sensor"), self.key.split("/")[2:], strict=True))


_ADAPTER = TypeAdapter(Parameters)


def encode(parameters: Parameters) -> bytes:
    """Encode the parameters as the JSON that `parse` reads."""
    return _ADAPTER.dump_json(parameters)


def parse(text: bytes) -> Parameters:
    """Parse the start parameters. Raises `ValueError`, which names the wrong entries in one line."""
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        raise ValueError("; ".join(describe_problems(error, "parameters"))) from None
