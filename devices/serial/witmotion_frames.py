"""Decoding of WitMotion's standard stream.

A frame is `55 id d0..d7 sum`, 11 bytes; the sum is the low byte of the sum of the first ten. Id 51 is acceleration: ax ay az T
as s16 little-endian, in counts of 16 g / 32768 and hundredths of a degree Celsius. The other ids (50..5F) are recognised and
skipped.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FRAME_BYTES = 11
"""Definition: of the protocol."""
HEADER = 0x55
ACCELERATION = 0x51
PIECE_BYTES = 4096
"""Size of the pieces that are decoded at a time. Basis: bounds the work after a fault."""


@dataclass(frozen=True, slots=True)
class Readings:
    """The acceleration frames of one piece of the stream, oldest first."""

    counts: NDArray[np.int32]
    """Shape (n, 3), 2048 per g."""
    temperature_c: NDArray[np.float64]
    """Shape (n,)."""
    lost_before: NDArray[np.int64]
    """Number of frames lost immediately before each frame, shape (n,): missing bytes divided by the usual distance."""
    invalid_before: NDArray[np.int64]
    """Number of damaged frames immediately before each frame, shape (n,)."""
    gyro_counts: NDArray[np.int32] | None = None
    """Angular rates, shape (n, 3); None where the frames have none."""

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def missing_before(self) -> NDArray[np.int64]:
        """Number of lost and damaged frames before each frame."""
        return self.lost_before + self.invalid_before


def join_readings(found: list[Readings]) -> Readings:
    """Return the readings of consecutive pieces as one."""
    rates = [readings.gyro_counts for readings in found if readings.gyro_counts is not None]
    return Readings(
        counts=np.concatenate([np.zeros((0, 3), np.int32), *(readings.counts for readings in found)]),
        temperature_c=np.concatenate([np.zeros(0), *(readings.temperature_c for readings in found)]),
        lost_before=np.concatenate([np.zeros(0, np.int64), *(readings.lost_before for readings in found)]),
        invalid_before=np.concatenate([np.zeros(0, np.int64), *(readings.invalid_before for readings in found)]),
        gyro_counts=np.concatenate(rates) if rates else None,
    )


class FrameDecoder:
    """Finds the frames in a stream of bytes; stores less than two frames.

    The decoder synchronises on two valid frames in a row, and then reads frames at their fixed distance. One bad frame is
    skipped; after the second bad frame in a row the search starts again one byte later.
    """

    def __init__(self) -> None:
        self.faults = {"checksum": 0, "false_start": 0, "discarded_bytes": 0}
        self.reset()

    def reset(self) -> None:
        """Discard the stream after the port was opened again; the counts remain."""
        self._buffer = b""
        self._locked = False
        self._consumed = 0
        self._last_at: int | None = None  # position of the newest acceleration frame in the stream
        self._last_distance = 0
        self._sample_bytes = 0  # usual distance between them; 0 until it has occurred twice in a row
        self._broken_frames = 0
        self._intact = True  # nothing was discarded since the newest acceleration frame

    @property
    def bytes_since_sample(self) -> int:
        """Number of bytes since the beginning of the newest acceleration frame, or since the start of the stream."""
        return self._consumed - (self._last_at or 0)

    def bytes_until(self, samples: int) -> int:
        """Return the number of bytes that are missing until the newest of so many samples is complete."""
        return max(samples * (self._sample_bytes or FRAME_BYTES) - len(self._buffer), 1)

    def feed(self, data: bytes) -> Readings:
        """Decode bytes; never raises, whatever they are."""
        pieces = [data[at : at + PIECE_BYTES] for at in range(0, len(data), PIECE_BYTES)]
        return join_readings([readings for piece in pieces for readings in self._decode(piece)])

    def _decode(self, piece: bytes) -> Iterator[Readings]:
        self._buffer += piece
        while self._locked or self._find_lock():
            slots = len(self._buffer) // FRAME_BYTES
            if not slots:
                return
            frames = np.frombuffer(self._buffer, np.uint8, slots * FRAME_BYTES).reshape(slots, FRAME_BYTES)
            valid = _valid(frames)
            good = slots if valid.all() else int(valid.argmin())
            if good:
                yield self._readings(frames[:good])
                self._consume(good * FRAME_BYTES)
            elif slots < 2:
                return  # the next frame shows whether the distance is still right
            else:
                self._skip_bad_frame(stride_holds=bool(valid[1]))

    def _find_lock(self) -> bool:
        at = 0
        while (at := self._buffer.find(HEADER, at)) >= 0:
            rest = len(self._buffer) - at
            if rest < FRAME_BYTES:
                break
            if _is_valid(self._buffer, at):
                if rest < 2 * FRAME_BYTES:
                    break
                if _is_valid(self._buffer, at + FRAME_BYTES):
                    self._discard(at)
                    self._locked = True
                    return True
                self.faults["false_start"] += 1
            at += 1
        self._discard(at if at >= 0 else len(self._buffer))
        return False

    def _skip_bad_frame(self, *, stride_holds: bool) -> None:
        self.faults["checksum"] += 1
        self._broken_frames += 1
        self._discard(FRAME_BYTES if stride_holds else 1)
        self._locked = stride_holds

    def _discard(self, count: int) -> None:
        if count:
            self._intact = False
            self.faults["discarded_bytes"] += count
            self._consume(count)

    def _consume(self, count: int) -> None:
        self._buffer = self._buffer[count:]
        self._consumed += count

    def _readings(self, frames: NDArray[np.uint8]) -> Readings:
        place = np.flatnonzero(frames[:, 1] == ACCELERATION)
        words = np.ascontiguousarray(frames[place, 2:10]).view("<i2")
        lost, invalid = np.zeros(len(place), np.int64), np.zeros(len(place), np.int64)
        if len(place):
            at = (self._consumed + FRAME_BYTES * place).tolist()
            missing = self._missing_before(at[0])
            invalid[0] = min(missing, self._broken_frames)
            lost[0] = missing - invalid[0]
            self._learn_distance(at)
        return Readings(words[:, :3].astype(np.int32), words[:, 3] / 100.0, lost, invalid)

    def _missing_before(self, at: int) -> int:
        """Return the number of missing acceleration frames before the one at this position."""
        if self._last_at is None or self._intact or not self._sample_bytes:
            return 0
        return max(round((at - self._last_at) / self._sample_bytes) - 1, 0)

    def _learn_distance(self, at: list[int]) -> None:
        """Record the positions of the newest acceleration frames; other frames may be between them."""
        if self._last_at is not None and self._intact:
            at = [self._last_at, *at]
        for earlier, later in pairwise(at):
            if later - earlier == self._last_distance:
                self._sample_bytes = self._last_distance
            self._last_distance = later - earlier
        self._last_at = at[-1]
        self._intact = True
        self._broken_frames = 0


def _valid(frames: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return whether each frame has the header, an id of the standard set (50..5F) and a correct sum; shape (n, 11) to (n,)."""
    total = frames[:, :10].sum(axis=1, dtype=np.uint8)
    valid: NDArray[np.bool_] = (frames[:, 0] == HEADER) & (frames[:, 1] >> 4 == 5) & (total == frames[:, 10])
    return valid


def _is_valid(data: bytes, at: int) -> bool:
    """Return the same for one frame at this position."""
    return data[at] == HEADER and data[at + 1] >> 4 == 5 and sum(data[at : at + 10]) & 0xFF == data[at + 10]
