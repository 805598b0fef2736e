"""What the parent tells the page process at start: one JSON line on standard input.

The parent binds the listening socket itself, so that an occupied port is an error of its own start, and keeps standard
input open for as long as the page shall live: the page ends when it closes, however the parent died.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from gateway.errors import describe_problems

LONGEST_LINE = 65536
Key = Annotated[str, Field(pattern=r"^plumbline/v1/[^/*$#?]+/[^/*$#?]+/[^/*$#?]+$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Start parameters of the page process."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    key: Key
    """Zenoh key of the sensor, `plumbline/v1/<site>/<crane>/<sensor>`."""
    connect: Annotated[list[str], Field(min_length=1)]
    """Zenoh endpoints of the gateway or of its router."""
    warn_deg: Positive
    trip_deg: Positive
    fd: Annotated[int, Field(ge=0)] = 0
    """Number of the inherited listening socket; `launch.start` fills it in."""
    stale_s: Positive = 1.0
    """A value older than this, beyond the usual pause of its topic, is stale."""
    lean_trip_deg: Positive | None = None
    title: str = ""
    """Shown in place of the sensor's name."""

    @property
    def place(self) -> dict[str, str]:
        """Site, crane and sensor of the key."""
        return dict(zip(("site", "crane", "sensor"), self.key.split("/")[2:], strict=True))


_ADAPTER = TypeAdapter(Parameters)


def encode(parameters: Parameters) -> bytes:
    """The line that `parse` reads."""
    return _ADAPTER.dump_json(parameters) + b"\n"


def parse(line: bytes) -> Parameters:
    """Read the start line. Raises `ValueError` that names the wrong entries in one line."""
    try:
        return _ADAPTER.validate_json(line)
    except ValidationError as error:
        raise ValueError("; ".join(describe_problems(error, "line"))) from None
