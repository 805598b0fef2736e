"""A chip on an I2C bus at the place of `smbus2.SMBus`, and everything that can go wrong on its wires; and a clock that moves only
when it is used.

Knows nothing of any driver. Bus transfers take their time. Each chip adds its registers and its FIFO by its data sheet.
"""

import ctypes
import errno
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from smbus2 import i2c_msg

I2C_M_RD = 1
START_NS = 1_700_000_000_000_000_000

Signal = Callable[[float], tuple[float, float, float]]


class FakeClock:
    """Time passes when somebody sleeps (which may last up to `oversleep_s` longer) or a transfer takes place."""

    def __init__(self, oversleep_s: float = 0.0, seed: int = 1) -> None:
        self.time_ns = self.start_ns = START_NS
        self.oversleep_s = oversleep_s
        self._random = np.random.default_rng(seed)

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_s(self, seconds: float) -> None:
        if seconds > 0:
            self.pass_s(seconds + self._random.uniform(0, self.oversleep_s))

    def pass_s(self, seconds: float) -> None:
        self.time_ns += round(seconds * 1e9)

    @property
    def elapsed_s(self) -> float:
        return (self.time_ns - START_NS) / 1e9


@dataclass
class Failure:
    """Transfers that fail: which errno, how many, only those of one register, after how many samples or entries went out."""

    errno: int
    times: int
    register: int | None
    popped: int


def level(time_s: float) -> tuple[float, float, float]:
    """At rest, z up."""
    return 0.0, 0.0, 1.0


class I2cChip(ABC):
    """Registers, a FIFO of `fifo_places`, each of them one sample or one entry, and an oscillator."""

    power_on: ClassVar[dict[int, int]]
    addresses: tuple[int, ...]
    fifo_places: int
    places_per_sample = 1
    fifo_register: int
    temperature_c = 25.0
    rates_deg_s = (0.0, 0.0, 0.0)
    self_test_g = (0.3, -0.3, 1.0)
    """Deflection of the mass by the self-test."""

    def __init__(
        self,
        clock: FakeClock,
        signal: Signal = level,
        *,
        rate_error: float = 0.0,
        address: int | None = None,
        bus_hz: float = 400_000,
    ) -> None:
        self.clock = clock
        self.signal = signal
        self.rate_error = rate_error
        self.address = self.addresses[0] if address is None else address
        self.bus_hz = bus_hz
        self.registers = dict(self.power_on)
        self.fifo: deque[bytes] = deque()
        self.made_ns: list[int] = []
        self.overwritten = 0
        self.log: list[tuple[str, int, int]] = []
        self.closed = False
        self.deaf: set[int] = set()
        self.stuck_high = False
        self.high_bursts = 0  # this many of the next reads of the FIFO are read as ones
        self.sda_low = False
        self.absent_until_s = 0.0  # a loose connector: until then no address is acknowledged
        self.oscillating = True
        self.disturbed: dict[int, list[int]] = {}  # by register: bits that turn over in its next reads
        self._failures: list[Failure] = []
        self._next_s = 0.0  # since START_NS: as ns since 1970 a float is too coarse
        self._pointer = 0
        self._started = False

    # What a test does to it

    def fail(self, number: int, times: int = 1, *, register: int | None = None, popped: int = 0) -> None:
        self._failures.append(Failure(number, times, register, popped))

    def recover(self) -> None:
        self._failures.clear()

    def brown_out(self) -> None:
        """Restore the defaults without a word, as a dip of the supply does."""
        self.registers = dict(self.power_on)
        self.fifo.clear()
        self._started = False

    def power_cycle(self) -> None:
        self.sda_low = False
        self.brown_out()

    def clear_bus(self) -> None:
        """Nine clock pulses and a stop: a chip that holds SDA low in the middle of a byte lets go."""
        self.sda_low = False

    def drop_places(self, count: int) -> None:
        for _ in range(min(count, len(self.fifo))):
            self.fifo.popleft()

    def run_s(self, seconds: float) -> None:
        self.clock.pass_s(seconds)
        self._sample()

    # By the data sheet

    @property
    @abstractmethod
    def odr_hz(self) -> float:
        """The rate that the registers set, with the error of the oscillator."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """Whether the registers let the chip sample."""

    @abstractmethod
    def encode(self, force_g: tuple[float, float, float]) -> list[bytes]:
        """One sample as places of the FIFO, in the range and resolution of the registers."""

    def write_register(self, register: int, value: int) -> None:
        self.registers[register] = value

    def read_register(self, register: int) -> int:
        return self.registers.get(register, 0)

    def next_register(self, register: int) -> int:
        return register + 1

    def overrun(self) -> None:
        """A sample found the FIFO full; the oldest one goes."""
        self.drop_places(self.places_per_sample)
        self.overwritten += 1

    @property
    def deflected(self) -> bool:
        """Whether the self-test deflects the mass."""
        return False

    @property
    def busy(self) -> bool:
        """Whether every register reads 0xFF."""
        return False

    @property
    def refusing(self) -> bool:
        """Whether the chip does not acknowledge its address."""
        return False

    def read_burst(self, length: int) -> bytes:
        data = bytearray()
        for _ in range(length):
            data.append(self._read_disturbed(self._pointer))
            self._pointer = self.next_register(self._pointer)
        return bytes(data)

    # The bus

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        if self.closed:
            raise OSError(errno.EBADF, "closed")
        if self.sda_low:
            self.clock.pass_s(1.0)
            raise OSError(errno.ETIMEDOUT, "SDA is low")
        if any(message.flags & I2C_M_RD for message in messages[:-1]):
            raise OSError(errno.EOPNOTSUPP, "the BCM2835 allows one read, as the last message")
        self._fail_as_told(bytes(messages[0])[0])
        for message in messages:
            self._take_bytes(1)
            absent = self.clock.elapsed_s < self.absent_until_s
            if absent or message.addr != self.address or self.refusing:
                raise OSError(errno.EREMOTEIO, "Remote I/O error")
            self._sample()
            if message.flags & I2C_M_RD:
                self.log.append(("read", self._pointer, message.len))
                data = self._answer(message.len)
                ctypes.memmove(message.buf, data, message.len)
            else:
                self._write(bytes(message))
            self._take_bytes(message.len)
        self._sample()

    def close(self) -> None:
        self.closed = True

    def _answer(self, length: int) -> bytes:
        high = self.stuck_high or self.busy
        if self._pointer == self.fifo_register and self.high_bursts:
            self.high_bursts -= 1
            self.read_burst(length)
            high = True
        return b"\xff" * length if high else self.read_burst(length)

    def _take_bytes(self, count: int) -> None:
        self.clock.pass_s(9 * count / self.bus_hz)

    def _fail_as_told(self, register: int) -> None:
        for failure in self._failures:
            if failure.times and failure.register in (None, register):
                failure.times -= 1
                self._sample()
                self.drop_places(failure.popped)
                self.clock.pass_s(1.0 if failure.errno == errno.ETIMEDOUT else 0.0002)
                raise OSError(failure.errno, "told to fail")

    def _write(self, data: bytes) -> None:
        self._pointer = data[0]
        for value in data[1:]:
            self.log.append(("write", self._pointer, value))
            if self._pointer not in self.deaf and not self.busy:
                self.write_register(self._pointer, value)
            self._pointer = self.next_register(self._pointer)

    def _read_disturbed(self, register: int) -> int:
        bits = self.disturbed.get(register)
        return self.read_register(register) ^ (bits.pop(0) if bits else 0)

    # The oscillator

    def _sample(self) -> None:
        if not self.running:
            self._started = False
            return
        if not self._started:
            self._started = True
            self._next_s = self.clock.elapsed_s + 1 / self.odr_hz
        while self._next_s <= self.clock.elapsed_s:
            if self.oscillating:
                self._make_sample(self._next_s)
            self._next_s += 1 / self.odr_hz

    def _make_sample(self, time_s: float) -> None:
        if len(self.fifo) + self.places_per_sample > self.fifo_places:
            self.overrun()
        x, y, z = (g + self.deflected * test_g for g, test_g in zip(self.signal(time_s), self.self_test_g, strict=True))
        self.fifo.extend(self.encode((x, y, z)))
        self.made_ns.append(START_NS + round(time_s * 1e9))


def to_counts(force_g: float, lsb_per_g: float, bits: int) -> int:
    """Rounded and limited to the range of a two's complement number."""
    return min(max(round(force_g * lsb_per_g), -(1 << (bits - 1))), (1 << (bits - 1)) - 1)
