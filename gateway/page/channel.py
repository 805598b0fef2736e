"""What a gateway and its page share: a private channel, the start parameters in its first frame, and the socket of the page.

The channel has one message for each packet of a pair of connected sockets. The page inherits its end as standard input: nobody
else can reach it, and the page ends when it closes. The gateway binds the listening socket, so that an occupied port is an error
at its own start.
"""

import socket
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from gateway.errors import describe_problems
from gateway.topics import KEY_PREFIX

MAX_FRAME_BYTES = 65536
"""Largest packet, bytes. Basis: a message on the bus may have as much; the socket takes it at once."""
PARAMETERS = "parameters"
"""The first frame of the gateway."""
PAST_ALERT = "past_alert"
"""A frame with a change of an alert from before the start of the page."""
REQUEST = "request"
"""A frame of the page, which the gateway answers."""
ANSWER = "answer"
REPORT = "report"
"""A frame of the page that is not answered: wrong PINs."""
Key = Annotated[str, Field(pattern=rf"^{KEY_PREFIX}[^/*$#?]+/[^/*$#?]+/[^/*$#?]+$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@dataclass(frozen=True, slots=True)
class Frame:
    """A message, a request, an answer or a report."""

    kind: str
    """The topic, `PARAMETERS`, `PAST_ALERT`, `REQUEST`, `ANSWER` or `REPORT`."""
    at_s: float
    """When it was made, on the monotonic clock that all processes of a machine share."""
    payload: bytes


def open_pair() -> tuple[socket.socket, socket.socket]:
    """Return the two ends. The kernel keeps the borders of the packets and reports the end of either process."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame as one packet: kind, time, and the payload behind the first end of line."""
    return b"%s %.6f\n%s" % (frame.kind.encode(), frame.at_s, frame.payload)


def decode_frame(packet: bytes) -> Frame:
    """Decode a packet. Raises `ValueError`."""
    head, _, payload = packet.partition(b"\n")
    kind, _, at_s = head.decode().partition(" ")
    return Frame(kind, float(at_s), payload)


def receive_frame(channel: socket.socket) -> Frame | None:
    """Receive one frame; None at the end of the channel.

    Raises `ValueError` for a packet of wrong form or size, and `OSError`.
    """
    packet = channel.recv(MAX_FRAME_BYTES + 1)
    if not packet:
        return None
    if len(packet) > MAX_FRAME_BYTES:
        raise ValueError("a frame is too large")
    return decode_frame(packet)


def place_of(key: str) -> dict[str, str]:
    """Return site, crane and sensor of a key, `plumbline/v1/<site>/<crane>/<sensor>`, by these names."""
    return dict(zip(("site", "crane", "sensor"), key.split("/")[2:], strict=True))


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
    clear_deg: Positive | None = None
    """Level below which a warning ends."""
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
        return place_of(self.key)


_PARAMETERS = TypeAdapter(Parameters)


def encode_parameters(parameters: Parameters) -> bytes:
    """Encode the parameters as the JSON that `parse_parameters` reads."""
    return _PARAMETERS.dump_json(parameters)


def parse_parameters(text: bytes) -> Parameters:
    """Parse the start parameters. Raises `ValueError`, which names the wrong entries in one line."""
    try:
        return _PARAMETERS.validate_json(text)
    except ValidationError as error:
        raise ValueError("; ".join(describe_problems(error, "parameters"))) from None


def listen_at(host: str, port: int, backlog: int | None = None) -> socket.socket:
    """Return a socket that listens at an address, of IPv6 too. Raises `OSError`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, backlog=backlog)
