"""The protocol of an accelerometer chip with registers and a FIFO on an I2C bus: registers and decoding only.

`devices.i2c.fifo_accelerometer` does what all of them share: opening, reading in time, sample times, checks and counting of
faults.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from devices.clock import Clock
from devices.i2c.bus import I2cPart
from devices.i2c.chips import ChipKind, Identity

SAMPLE_BYTES = 6
"""Definition: three axes of 16 bits."""


class Setting(NamedTuple):
    """A register of the configuration and its value."""

    register: int
    name: str
    value: int


@dataclass(frozen=True, slots=True)
class FifoLevel:
    """The contents of a FIFO at one reading of its status."""

    samples: int
    """Number of complete samples that can be read."""
    size: int
    """Amount to read, in the unit of the chip: samples or entries."""
    read_ns: int
    """Gateway time at which these samples were seen."""
    lost_at_least: int | None = None
    """After an overrun: least number of samples that were overwritten."""


@dataclass(frozen=True, slots=True)
class SampleRun:
    """Complete consecutive samples from a FIFO."""

    raw: NDArray[np.int32]
    """Counts, shape (n, 3)."""
    lost: int = 0
    """Number of samples before them that arrived broken."""
    gyro_counts: NDArray[np.int32] | None = None
    """Angular rates, shape (n, 3); None without a gyroscope."""

    def __len__(self) -> int:
        return len(self.raw)


AxisLimits = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class SelfTest:
    """How a chip deflects its mass by itself, and by how much its output must change."""

    register: int
    """A register of the configuration."""
    on_bits: int
    limits_g: Callable[[I2cPart], AxisLimits]
    """Smallest and largest change of x, y and z, g; a chip may contain its own."""
    odr_hz: float
    range_g: float
    off_bits: int = 0
    either_sign: bool = False
    """Whether the limits are of the magnitude of the change."""
    confirmed: bool = True
    """Whether two independent sources state the limits; a result beyond others is a warning."""


class ImplausibleStatusError(Exception):
    """A status has bits that the chip cannot set: a disturbed transfer, a bus that reads 0xFF, or a lost configuration."""


class LostAlignmentError(Exception):
    """The bytes of a FIFO do not begin with a sample. The chip has discarded them."""


class AccelerometerChip(Protocol):
    """A chip at one rate and range. Every method may raise `TransferError`.

    A class that inherits from it has no revision, no reset and no temperature, and reads whole samples, unless it says otherwise.
    """

    kind: ChipKind
    info: DeviceInfo
    """Nominal properties at the rate and range; identity and details are added where a part is opened."""
    saturation_counts: tuple[int, int]
    """Lowest and highest reading: one at or beyond them is at the end of the range, and its true value may be larger."""
    longest_block: int
    """Largest number of samples that a read waits for: half of the FIFO, so that the rest remains free for a late host."""
    self_test: SelfTest | None
    configuration: tuple[Setting, ...]
    """In the order of writing; the last one starts the chip. A register that occurs twice must keep its last value."""

    def revision(self, part: I2cPart, identity: Identity) -> str:
        """Return the revision of the part that was identified, or an empty text."""
        return ""

    def reset(self, part: I2cPart, clock: Clock) -> None:
        """Restore the defaults, and wait until the chip is ready."""
        return

    def fifo_level(self, part: I2cPart, clock: Clock) -> FifoLevel:
        """Return the contents of the FIFO. Raises `ImplausibleStatusError`."""
        ...

    def read_fifo(self, part: I2cPart, size: int) -> list[SampleRun]:
        """Read as much as `FifoLevel.size` says. Raises `LostAlignmentError`."""
        ...

    def forget_partial(self) -> None:
        """Discard a part of a sample that was read, because the rest of it is lost."""
        return

    def temperature_c(self, part: I2cPart) -> float | None:
        """Return the temperature; None where the chip has no sensor for it, or its reading changes all the time."""
        return None


def decode_samples(data: bytes, shift: int = 0) -> list[SampleRun]:
    """Return the samples of 6 n bytes: x, y, z in two's complement, little-endian, `shift` unused bits on the right.

    A sample of nothing but ones came from a bus that nobody drove, and is counted as lost.
    """
    words = np.frombuffer(data, dtype="<i2").reshape(-1, 3)
    counts = words.astype(np.int32) >> shift
    return split_runs(counts, ~(words == -1).all(axis=1))


def split_runs(counts: NDArray[np.int32], usable: NDArray[np.bool_]) -> list[SampleRun]:
    """Return the runs of usable samples, shape (n, 3), with the number of unusable ones before each."""
    if usable.all():
        return [SampleRun(counts)] if len(counts) else []
    edges = [0, *(np.flatnonzero(np.diff(usable)) + 1).tolist(), len(counts)]
    runs, lost = [], 0
    for first, end in pairwise(edges):
        if usable[first]:
            runs.append(SampleRun(counts[first:end], lost))
            lost = 0
        else:
            lost = end - first
    return [*runs, SampleRun(counts[:0], lost)] if lost else runs
