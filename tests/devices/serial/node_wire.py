"""What a node sends: the state of its counters and its clock, and the frames of its samples."""

import numpy as np
from numpy.typing import NDArray

from devices.serial.node_frames import NodeFrame, encode_frame

SCALE_NG = 61035


class Node:
    """A node that samples at its own rate. Each sample carries its own number on x."""

    def __init__(self, *, node: int = 7, rate_hz: float = 100.0, boot: int = 1, per_frame: int = 5) -> None:
        self.node, self.rate_hz, self.boot, self.per_frame = node, rate_hz, boot, per_frame
        self.sequence = 0
        self.t_us = 0.0

    def frame(self, n: int | None = None, **changes: object) -> bytes:
        """Return the next frame of n samples."""
        return encode_frame(self.next_frame(n, **changes))

    def next_frame(self, n: int | None = None, **changes: object) -> NodeFrame:
        n = n or self.per_frame
        numbers = np.arange(self.sequence, self.sequence + n) % 30000
        self.sequence += n
        self.t_us += n * 1e6 / self.rate_hz
        fields: dict[str, object] = {
            "node": self.node,
            "boot": self.boot,
            "sequence": (self.sequence - n) % 2**32,
            "t_us": round(self.t_us),
            "scale_ng": SCALE_NG,
            "counts": np.stack([numbers, -numbers, np.full(n, 16384)], axis=1).astype(np.int16),
            "temperature_c": 21.5,
            "battery_v": 3.7,
            "signal_dbm": -67.0,
        }
        return NodeFrame(**(fields | changes))  # type: ignore[arg-type]

    def frames(self, count: int) -> bytes:
        return b"".join(self.frame() for _ in range(count))

    def restart(self, boot: int | None = None) -> None:
        """Start again, as after a reset."""
        self.boot = self.boot + 1 if boot is None else boot
        self.sequence, self.t_us = 0, 0.0

    def lose(self, frames: int) -> None:
        """Send frames that nobody receives."""
        for _ in range(frames):
            self.frame()


def numbers_of(raw_g: NDArray[np.float64] | NDArray[np.int32]) -> list[int]:
    """Return the numbers of samples."""
    numbers: list[int] = np.rint(raw_g[:, 0] / (SCALE_NG * 1e-9)).astype(int).tolist()
    return numbers
