"""The frames of a radio node of one's own (docs/guides/integrator/node.md): encoding, and decoding of a stream."""

import binascii
import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

MAX_RUN_BYTES = 254
"""Number of bytes without a zero that one code byte can announce. Definition: consistent overhead byte stuffing (Cheshire and
Baker 1999)."""
VERSION = 1
HEADER = struct.Struct("<BBHIIIQHhHbB")
"""version, flags, boot, node, sequence, scale_ng, t_us, full_scale, temperature, battery_mv, signal_dbm, count"""
CRC = struct.Struct("<H")
CRC_START = 0xFFFF
MAX_FRAME_SAMPLES = 40
"""Definition: docs/guides/integrator/node.md."""
BATTERY_LOW = 0x01
NO_TEMPERATURE, NO_BATTERY, NO_SIGNAL = -32768, 0, 127
"""Definition: values that stand for an unknown one (docs/guides/integrator/node.md)."""
MIN_FRAME_BYTES = HEADER.size + 6 + CRC.size + 2
"""Shortest frame: one sample, stuffed and with its delimiter. Definition: docs/guides/integrator/node.md."""
MAX_FRAME_BYTES = HEADER.size + 6 * MAX_FRAME_SAMPLES + CRC.size
"""Definition: docs/guides/integrator/node.md."""
MAX_ENCODED_BYTES = MAX_FRAME_BYTES + MAX_FRAME_BYTES // 254 + 1
"""Definition: a code byte for each run (Cheshire and Baker 1999)."""


def cobs_encode(data: bytes) -> bytes:
    """Return the data without zeros, so that a zero can delimit frames; without the delimiter.

    This is consistent overhead byte stuffing (Cheshire and Baker 1999).
    """
    encoded = bytearray()
    runs = data.split(b"\0")
    for index, run in enumerate(runs):
        for start in range(0, max(len(run), 1), MAX_RUN_BYTES):
            part = run[start : start + MAX_RUN_BYTES]
            encoded.append(len(part) + 1)
            encoded += part
        if run and len(run) % MAX_RUN_BYTES == 0 and index < len(runs) - 1:
            encoded.append(1)  # a code of 255 announces no zero; this one does
    return bytes(encoded)


def cobs_decode(encoded: bytes) -> bytes:
    """Return the data. Raises `ValueError` for a code that points beyond the end, and for a zero."""
    if 0 in encoded:
        raise ValueError("a zero within a frame")
    data, at = bytearray(), 0
    while at < len(encoded):
        code = encoded[at]
        if at + code > len(encoded):
            raise ValueError("a code byte points beyond the end of the frame")
        data += encoded[at + 1 : at + code]
        at += code
        if code <= MAX_RUN_BYTES and at < len(encoded):
            data.append(0)
    return bytes(data)


@dataclass(frozen=True, slots=True)
class NodeFrame:
    """What one frame contains."""

    node: int
    boot: int
    """Number of the node's present start, modulo 65536; another one after each reset."""
    sequence: int
    """Number of the first sample of the frame since the start of the node, modulo 2^32."""
    t_us: int
    """The node's clock at the last sample of the frame."""
    scale_ng: int
    """Specific force per count, in units of 1e-9 g."""
    counts: NDArray[np.int16]
    """Shape (n, 3)."""
    full_scale: int = 32767
    """A reading of at least this size is at the end of the sensor's range."""
    temperature_c: float | None = None
    battery_v: float | None = None
    battery_low: bool = False
    signal_dbm: float | None = None


class NodeFrameError(ValueError):
    """A frame cannot be used; `fault` is the name under which it is counted."""

    def __init__(self, fault: str) -> None:
        super().__init__(fault)
        self.fault = fault


def encode_frame(frame: NodeFrame) -> bytes:
    """Return the bytes of a frame, with the delimiter at the end."""
    data = (
        HEADER.pack(
            VERSION,
            BATTERY_LOW if frame.battery_low else 0,
            frame.boot,
            frame.node,
            frame.sequence,
            frame.scale_ng,
            frame.t_us,
            frame.full_scale,
            NO_TEMPERATURE if frame.temperature_c is None else round(frame.temperature_c * 100),
            NO_BATTERY if frame.battery_v is None else round(frame.battery_v * 1000),
            NO_SIGNAL if frame.signal_dbm is None else round(frame.signal_dbm),
            len(frame.counts),
        )
        + frame.counts.astype("<i2").tobytes()
    )
    return cobs_encode(data + CRC.pack(binascii.crc_hqx(data, CRC_START))) + b"\0"


def decode_frame(encoded: bytes) -> NodeFrame:
    """Return the frame between two delimiters. Raises `NodeFrameError`."""
    try:
        data = cobs_decode(encoded)
    except ValueError as error:
        raise NodeFrameError("stuffing") from error
    if len(data) < HEADER.size + CRC.size:
        raise NodeFrameError("length")
    data, (crc,) = data[: -CRC.size], CRC.unpack(data[-CRC.size :])
    if binascii.crc_hqx(data, CRC_START) != crc:
        raise NodeFrameError("checksum")
    version, flags, boot, node, sequence, scale_ng, t_us, full_scale, temperature, battery_mv, signal_dbm, count = (
        HEADER.unpack_from(data)
    )
    if version != VERSION:
        raise NodeFrameError("version")
    if not 1 <= count <= MAX_FRAME_SAMPLES or len(data) != HEADER.size + 6 * count or not scale_ng or not full_scale:
        raise NodeFrameError("length")
    return NodeFrame(
        node=node,
        boot=boot,
        sequence=sequence,
        t_us=t_us,
        scale_ng=scale_ng,
        counts=np.frombuffer(data, "<i2", offset=HEADER.size).reshape(count, 3),
        full_scale=full_scale,
        temperature_c=None if temperature == NO_TEMPERATURE else temperature / 100,
        battery_v=None if battery_mv == NO_BATTERY else battery_mv / 1000,
        battery_low=bool(flags & BATTERY_LOW),
        signal_dbm=None if signal_dbm == NO_SIGNAL else float(signal_dbm),
    )


@dataclass(slots=True)
class NodeFrameDecoder:
    """Finds the frames in a stream of bytes; stores less than one frame."""

    faults: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("checksum", "stuffing", "length", "version"), 0)
    )
    bytes_since_frame: int = 0
    """Number of bytes since the end of the newest frame, or since the start of the stream."""
    _buffer: bytearray = field(default_factory=bytearray)
    _joined: bool = False
    """A delimiter has been seen; before it, the rest of a frame is no fault."""

    def reset(self) -> None:
        """Discard the stream after the port was opened again; the counts remain."""
        self._buffer.clear()
        self._joined = False
        self.bytes_since_frame = 0

    def bytes_until(self, frames: int, frame_bytes: int) -> int:
        """Return the number of bytes that are missing until so many frames of a length are complete."""
        return max(frames * frame_bytes - len(self._buffer), 1)

    def feed(self, data: bytes) -> list[NodeFrame]:
        """Decode bytes; never raises, whatever they are."""
        self._buffer += data
        *pieces, rest = bytes(self._buffer).split(b"\0")
        frames = []
        for piece in pieces:
            self.bytes_since_frame += len(piece) + 1
            frame = self._decode(piece)
            if frame is not None:
                frames.append(frame)
                self.bytes_since_frame = 0
            self._joined = True
        if len(rest) > MAX_ENCODED_BYTES:  # no delimiter comes: not a node, or another baud rate
            self.bytes_since_frame += len(rest)
            self.faults["length"] += self._joined
            self._joined = False
            rest = b""
        self._buffer = bytearray(rest)
        return frames

    def _decode(self, piece: bytes) -> NodeFrame | None:
        if not piece:  # two delimiters in a row are no fault: a node may begin a frame with one
            return None
        try:
            return decode_frame(piece)
        except NodeFrameError as error:
            self.faults[error.fault] += self._joined
            return None
