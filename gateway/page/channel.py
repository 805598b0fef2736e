"""The private channel between a gateway and its page: one message for each packet of a pair of connected sockets.

The page inherits its end as standard input. Nobody else can reach the channel, and the page ends when it closes.
"""

import socket
from dataclasses import dataclass

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
