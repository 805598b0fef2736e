"""An ADXL355 as its data sheet describes it, at the place of `smbus2.SMBus`; and a clock that moves only when it is used.

Knows nothing of the driver. Registers, FIFO and status bits behave as on the part; bus transfers take their time.
"""

import ctypes
import errno
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from smbus2 import i2c_msg

I2C_M_RD = 1
START_NS = 1_700_000_000_000_000_000
FIFO_LOCATIONS = 96
EMPTY_LOCATION = bytes([0, 0, 0b10])
POWER_ON = {0x00: 0xAD, 0x01: 0x1D, 0x02: 0xED, 0x28: 0x00, 0x29: 0x60, 0x2A: 0x00, 0x2B: 0x00, 0x2C: 0x81, 0x2D: 0x01}
STANDBY_ONLY = range(0x1E, 0x2D)  # offsets, activity, filter, FIFO, interrupts, synchronisation, range
LSB_PER_G = {1: 256000, 2: 128000, 3: 64000}

Signal = Callable[[float], tuple[float, float, float]]


class FakeClock:
    """Time passes when somebody sleeps (which may last up to `oversleep_s` longer) or a transfer takes place."""

    def __init__(self, oversleep_s: float = 0.0, seed: int = 1) -> None:
        self.time_ns = START_NS
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
    """Transfers that fail: which errno, how many, only those of one register, after how many FIFO locations went out."""

    errno: int
    times: int
    register: int | None
    popped: int


def level(time_s: float) -> tuple[float, float, float]:
    """At rest, z up."""
    return 0.0, 0.0, 1.0


class Adxl355Chip:
    def __init__(
        self,
        clock: FakeClock,
        signal: Signal = level,
        *,
        rate_error: float = 0.0,
        address: int = 0x1D,
        revision: int = 0x01,
        bus_hz: float = 400_000,
        busy_s: float = 0.003,
        refuses_while_busy: bool = False,
    ) -> None:
        self.clock = clock
        self.signal = signal
        self.rate_error = rate_error
        self.address = address
        self.bus_hz = bus_hz
        self.busy_s = busy_s
        self.refuses_while_busy = refuses_while_busy
        self.registers = {**POWER_ON, 0x03: revision}
        self.fifo: deque[bytes] = deque()
        self.made_ns: list[int] = []
        self.overwritten = 0
        self.log: list[tuple[str, int, int]] = []
        self.closed = False
        self.temperature_raw = 1885
        self.temperature_steps: list[int] = []
        self.deaf: set[int] = set()
        self.stuck_high = False
        self.oscillating = True
        self.level_error = 0
        self.disturbed: dict[int, list[int]] = {}  # by register: bits that turn over in its next reads
        self._failures: list[Failure] = []
        self._busy_until_ns = 0
        self._next_s = 0.0  # since START_NS: as ns since 1970 a float is too coarse
        self._ready = self._overrun = False
        self._pointer = 0

    # What a test does to it

    def fail(self, number: int, times: int = 1, *, register: int | None = None, popped: int = 0) -> None:
        self._failures.append(Failure(number, times, register, popped))

    def brown_out(self) -> None:
        revision = self.registers[0x03]
        self.registers = {**POWER_ON, 0x03: revision}
        self.fifo.clear()
        self._ready = self._overrun = False

    def drop_entries(self, count: int) -> None:
        for _ in range(min(count, len(self.fifo))):
            self.fifo.popleft()

    def run_s(self, seconds: float) -> None:
        self.clock.pass_s(seconds)
        self._sample()

    @property
    def odr_hz(self) -> float:
        return 4000.0 / (1 << min(self.registers[0x28] & 0x0F, 10)) * (1 + self.rate_error)

    # The bus

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        if self.closed:
            raise OSError(errno.EBADF, "closed")
        first = bytes(messages[0])
        self._fail_as_told(first[0])
        for message in messages:
            self._take_bytes(1)
            refuses = self.refuses_while_busy and self.clock.now_ns() < self._busy_until_ns
            if message.addr != self.address or refuses:
                raise OSError(errno.EREMOTEIO, "Remote I/O error")
            self._sample()
            if message.flags & I2C_M_RD:
                self.log.append(("read", self._pointer, message.len))
                ctypes.memmove(message.buf, self._read(message.len), message.len)
            else:
                self._write(bytes(message))
            self._take_bytes(message.len)
        self._sample()

    def close(self) -> None:
        self.closed = True

    def _take_bytes(self, count: int) -> None:
        self.clock.pass_s(9 * count / self.bus_hz)

    def _fail_as_told(self, register: int) -> None:
        for failure in self._failures:
            if failure.times and failure.register in (None, register):
                failure.times -= 1
                self._sample()
                self.drop_entries(failure.popped)
                self.clock.pass_s(1.0 if failure.errno == errno.ETIMEDOUT else 0.0002)
                raise OSError(failure.errno, "told to fail")

    # Registers

    def _write(self, data: bytes) -> None:
        self._pointer = data[0]
        for value in data[1:]:
            self.log.append(("write", self._pointer, value))
            self._write_register(self._pointer, value)
            self._pointer += 1

    def _write_register(self, register: int, value: int) -> None:
        standby = self.registers[0x2D] & 1
        if self.clock.now_ns() < self._busy_until_ns or register in self.deaf:
            return
        if register == 0x2F and value == 0x52:
            self.brown_out()
            self._busy_until_ns = self.clock.now_ns() + round(self.busy_s * 1e9)
        elif register == 0x2D:
            if standby and not value & 1:
                self._next_s = self.clock.elapsed_s + 1 / self.odr_hz
            self.registers[register] = value
        elif register in STANDBY_ONLY and standby:
            self.registers[register] = value

    def _read(self, length: int) -> bytes:
        if self.stuck_high or self.clock.now_ns() < self._busy_until_ns:
            return b"\xff" * length
        if self._pointer == 0x11:
            locations = [self._pop() for _ in range(-(-length // 3))]
            return b"".join(locations)[:length]
        data = bytes(self._read_disturbed(self._pointer + i) for i in range(length))
        self._pointer += length
        return data

    def _read_disturbed(self, register: int) -> int:
        bits = self.disturbed.get(register)
        return self._read_register(register) ^ (bits.pop(0) if bits else 0)

    def _read_register(self, register: int) -> int:
        if register == 0x04:
            full = len(self.fifo) >= self.registers[0x29]
            status = self._ready | full << 1 | self._overrun << 2
            self._ready = self._overrun = False
            return status
        if register == 0x05:
            return max(len(self.fifo) + self.level_error, 0)
        if register in (0x06, 0x07):
            raw = self.temperature_steps.pop(0) if self.temperature_steps else self.temperature_raw
            return raw >> 8 if register == 0x06 else raw & 0xFF
        return self.registers.get(register, 0)

    def _pop(self) -> bytes:
        return self.fifo.popleft() if self.fifo else EMPTY_LOCATION

    # The accelerometer

    def _sample(self) -> None:
        while not self.registers[0x2D] & 1 and self._next_s <= self.clock.elapsed_s:
            if self.oscillating:
                self._make_sample(self._next_s)
            self._next_s += 1 / self.odr_hz

    def _make_sample(self, time_s: float) -> None:
        if len(self.fifo) + 3 > FIFO_LOCATIONS:
            self.drop_entries(3)
            self.overwritten += 1
            self._overrun = True
        lsb_per_g = LSB_PER_G[self.registers[0x2C] & 3]
        for axis, force_g in enumerate(self.signal(time_s)):
            counts = min(max(round(force_g * lsb_per_g), -(1 << 19)), (1 << 19) - 1)
            self.fifo.append((((counts & 0xFFFFF) << 4) | (axis == 0)).to_bytes(3, "big"))
        self.made_ns.append(START_NS + round(time_s * 1e9))
        self._ready = True
