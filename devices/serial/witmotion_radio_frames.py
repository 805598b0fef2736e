"""Decoding of the frames of WitMotion's radio sensors (Bluetooth Low Energy), as a receiver passes them on.

A frame has 20 bytes and no checksum. `55 61` is followed by nine s16, little-endian: acceleration (counts of 16 g / 32768),
angular rate (2000 deg/s / 32768) and angle, each x, y, z. `55 71` answers `FF AA 27 <register> 00`: the register as u16 and
eight registers from there on.

Without a checksum a flipped bit within the numbers cannot be seen. Lost and additional bytes can: a frame is used only if the
header of the next one follows it directly.
"""

import math
import struct

import numpy as np

from devices.serial.witmotion_frames import HEADER, PIECE_BYTES, Readings, join_readings

FRAME_BYTES = 20
"""Definition: of the protocol."""
READINGS, REGISTERS = b"\x55\x61", b"\x55\x71"
LOCK_FRAMES = 3
"""So many headers at the right distance begin the reading of frames. Basis: random bytes pass once in 3.6e13 positions."""
RAD_S_PER_UNIT = math.radians(2000.0) / 32768
"""Definition: of the protocol, 2000 deg/s over 16 bits."""


class RadioFrameDecoder:
    """Finds the frames in a stream of bytes; stores less than four frames."""

    def __init__(self) -> None:
        self.faults = {"header": 0, "discarded_bytes": 0}
        self.registers: dict[int, int] = {}
        """The first register of each answer since they were last taken, as u16."""
        self.reset()

    def reset(self) -> None:
        """Discard the stream after the port was opened again; the counts remain."""
        self._buffer = b""
        self._locked = False
        self._since_frame = 0
        self._missing_bytes: int | None = None  # since the newest frame; None before the first
        self.registers.clear()

    @property
    def bytes_since_sample(self) -> int:
        """Number of bytes since the newest frame of readings, or since the start of the stream."""
        return self._since_frame + len(self._buffer)

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the newest of so many samples, and the header after it, are there."""
        return max(samples * FRAME_BYTES + len(READINGS) - len(self._buffer), 1)

    def feed(self, data: bytes) -> Readings:
        """Decode bytes; never raises, whatever they are."""
        pieces = [data[at : at + PIECE_BYTES] for at in range(0, len(data), PIECE_BYTES)]
        return join_readings([readings for piece in pieces for readings in self._decode(piece)])

    def _decode(self, piece: bytes) -> list[Readings]:
        self._buffer += piece
        found = []
        while self._locked or self._find_lock():
            count = self._complete_frames()
            if count:
                found.append(self._take(count))
            elif len(self._buffer) < FRAME_BYTES + len(READINGS):
                break
            else:
                self.faults["header"] += 1
                self._discard(1)  # the frame or its header is damaged: search again within it
                self._locked = False
        return found

    def _find_lock(self) -> bool:
        span = (LOCK_FRAMES - 1) * FRAME_BYTES + len(READINGS)
        at = 0
        while (at := self._buffer.find(HEADER, at)) >= 0 and at + span <= len(self._buffer):
            if all(_is_header(self._buffer, at + place * FRAME_BYTES) for place in range(LOCK_FRAMES)):
                self._discard(at)
                self._locked = True
                return True
            at += 1
        self._discard(at if at >= 0 else len(self._buffer))
        return False

    def _complete_frames(self) -> int:
        """Return the number of frames from the start of the buffer on that are followed by a header."""
        count = 0
        while _is_header(self._buffer, (count + 1) * FRAME_BYTES):
            count += 1
        return count

    def _take(self, count: int) -> Readings:
        frames = np.frombuffer(self._buffer, np.uint8, count * FRAME_BYTES).reshape(count, FRAME_BYTES)
        answers = frames[:, 1] == REGISTERS[1]
        for frame in frames[answers]:
            first, value = struct.unpack_from("<2H", frame, 2)
            self.registers[first] = value
        words = np.ascontiguousarray(frames[~answers, 2:]).view("<i2")
        missing = np.zeros(len(words), np.int64)
        if len(words):
            missing[0] = round((self._missing_bytes or 0) / FRAME_BYTES)
            self._missing_bytes = 0
            self._since_frame = 0
        self._buffer = self._buffer[count * FRAME_BYTES :]
        return Readings(
            counts=words[:, :3].astype(np.int32),
            temperature_c=np.full(len(words), np.nan),
            lost_before=np.zeros(len(words), np.int64),
            invalid_before=missing,
            gyro_counts=words[:, 3:6].astype(np.int32),
        )

    def _discard(self, count: int) -> None:
        self._buffer = self._buffer[count:]
        self._since_frame += count
        if self._missing_bytes is not None:
            self._missing_bytes += count
        self.faults["discarded_bytes"] += count


def _is_header(data: bytes, at: int) -> bool:
    return data[at : at + 2] in (READINGS, REGISTERS)
