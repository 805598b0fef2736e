"""A WitMotion receiver on a pseudo-terminal whose sensor somebody turns, with errors that a calibration should find."""

import os
import pty
import struct
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

RATE_HZ = 400
BURST = 4
COUNTS_PER_G = 2048.0
OFFSET_G = np.array([0.030, -0.020, 0.045])
GAIN = np.array([[1.02, 0.004, 0.0], [-0.003, 0.985, 0.002], [0.001, 0.0, 1.015]])
NOISE_G = 0.001
FACES = {
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}


class TurnedRadio:
    """A WitMotion receiver on a pseudo-terminal whose sensor somebody turns."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.force_g = np.array([0.0, 0.0, 1.0])
        self._random = np.random.default_rng(3)
        self._stopping = threading.Event()
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        link.symlink_to(os.ttyname(self._slave))
        self._sender = threading.Thread(target=self._send)
        self._sender.start()

    def _send(self) -> None:
        due_s = time.monotonic()
        while not self._stopping.is_set():
            reading_g = GAIN @ self.force_g + OFFSET_G + self._random.normal(0, NOISE_G, (BURST, 3))
            words = np.rint(reading_g * COUNTS_PER_G).astype(int)
            with suppress(BlockingIOError):  # nobody reads: a radio sends all the same
                os.write(self._master, b"".join(self._frame(row) for row in words))
            due_s += BURST / RATE_HZ
            time.sleep(max(0.0, due_s - time.monotonic()))

    @staticmethod
    def _frame(words: NDArray[np.int64]) -> bytes:
        head = struct.pack("<BB4h", 0x55, 0x51, *words, 2500)
        return head + bytes([sum(head) & 0xFF])

    def turn(self, face: str) -> None:
        self.force_g = np.array(FACES[face], dtype=float)

    def close(self) -> None:
        self._stopping.set()
        self._sender.join()
        os.close(self._slave)
        os.close(self._master)
