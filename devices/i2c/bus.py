"""The parts on an I2C bus, through Linux i2c-dev: transfers with one of them, its identity, and the search for all of them.

All transfers use `i2c_rdwr`: a register read of any length is one ioctl with a write and a read joined by a repeated start.
SMBus block reads are limited to 32 bytes.
"""

import errno
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from smbus2 import SMBus, i2c_msg

from devices.clock import Clock
from devices.errors import (
    ConfigurationReadBackError,
    DeviceAccessError,
    DeviceError,
    DeviceNotFoundError,
    IdentityError,
    TransferError,
)
from devices.i2c.chips import IDENTITIES, Identity

MAX_ATTEMPTS = 3
"""Basis: a choice; single disturbances pass, and a part that does not answer is told soon."""
RETRY_PAUSE_S = 0.001
"""Basis: a choice; longer than a disturbance by a switch, shorter than a FIFO takes to overflow."""
RETRY_LIMIT_NS = 250_000_000
"""No further attempt after this time. Basis: a timeout of the kernel alone may take a second."""
ADDRESSES = range(0x08, 0x78)
"""The valid 7-bit addresses."""

NO_ACKNOWLEDGE = (errno.EREMOTEIO, errno.ENXIO)
FAULTS = {
    errno.EREMOTEIO: ("i2c_no_acknowledge", "no acknowledge; check wiring, supply and address"),
    errno.ENXIO: ("i2c_no_acknowledge", "no acknowledge; check wiring, supply and address"),
    errno.ETIMEDOUT: ("i2c_time_out", "time-out, a part holds the bus; check the pull-ups or power-cycle the sensor"),
    errno.EIO: ("i2c_bus_error", "bus error; shorten the cable or lower the bus speed"),
    errno.EAGAIN: ("i2c_bus_error", "the bus is taken; check for a second master and the pull-ups"),
}
"""By errno: the name in `I2cPart.faults`, and the meaning with the remedy."""
OTHER_FAULT = ("i2c_bus_error", "the transfer failed; reload the bus driver or restart the computer")


class Bus(Protocol):
    """The part of `smbus2.SMBus` that is used."""

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Do one combined transaction. Raises `OSError`."""
        ...

    def close(self) -> None:
        """Release the bus."""
        ...


BusOpener = Callable[[int], Bus]


class I2cPart:
    """Reads and writes registers; every failure is a `DeviceError` that names the bus and the address."""

    def __init__(self, bus: int, address: int, clock: Clock, open_bus: BusOpener = SMBus) -> None:
        if address not in ADDRESSES:
            raise ValueError(f"address {address:#04x} is not a 7-bit I2C address; give one of 0x08 to 0x77")
        self._number = bus
        self.address = address
        self._clock = clock
        self._open_bus = open_bus
        self._bus: Bus | None = None
        self.faults: Counter[str] = Counter()
        """Failed transfers by name, including those that succeeded at a further attempt."""

    def __str__(self) -> str:
        return f"I2C bus {self._number} address {self.address:#04x}"

    def open(self) -> None:
        """Open the bus, without any access to the part. Raises `DeviceNotFoundError`, `DeviceAccessError`."""
        self.close()
        path = f"/dev/i2c-{self._number}"
        try:
            self._bus = self._open_bus(self._number)
        except FileNotFoundError as error:
            raise DeviceNotFoundError(
                f"{path}: no such bus; enable I2C (raspi-config, Interface Options) or name another bus"
            ) from error
        except PermissionError as error:
            raise DeviceAccessError(
                f"{path}: may not be opened by this user; add it to the group i2c and log in again"
            ) from error
        except OSError as error:
            raise DeviceError(f"{path}: does not open as an I2C bus ({error.strerror}); name another bus") from error

    def close(self) -> None:
        """Release the bus; never raises, may be called twice."""
        if self._bus is not None:
            with suppress(OSError):
                self._bus.close()
            self._bus = None

    def read(self, register: int, length: int, *, consuming: bool = False) -> bytes:
        """Read `length` bytes from a register on. Raises `TransferError`.

        `consuming`: reading removes the bytes from the part (a FIFO). Such a read is repeated only when the part did not
        acknowledge, that is before its first byte.
        """
        answer = i2c_msg.read(self.address, length)
        self._transfer(i2c_msg.write(self.address, (register,)), answer, repeatable=not consuming)
        return bytes(answer)

    def write(self, register: int, *values: int) -> None:
        """Write one or more bytes from a register on. Raises `TransferError`."""
        self._transfer(i2c_msg.write(self.address, (register, *values)))

    def write_checked(self, register: int, value: int, name: str) -> None:
        """Write one register and read it back. Raises `ConfigurationReadBackError`, `TransferError`."""
        self.write(register, value)
        found = self.read(register, 1)[0]
        if found != value:
            raise ConfigurationReadBackError(
                f"{self}: register {name} ({register:#04x}) reads {found:#04x} after {value:#04x} was written;"
                " check supply, cable and part"
            )

    def _transfer(self, *messages: i2c_msg, repeatable: bool = True) -> None:
        if self._bus is None:
            raise TransferError(f"{self}: the bus is not open; open it first")
        start_ns = self._clock.now_ns()
        for attempt in range(1, MAX_ATTEMPTS + 1):
            try:
                self._bus.i2c_rdwr(*messages)
            except OSError as error:
                name, meaning = FAULTS.get(error.errno or 0, OTHER_FAULT)
                self.faults[name] += 1
                late = self._clock.now_ns() - start_ns > RETRY_LIMIT_NS
                if attempt == MAX_ATTEMPTS or late or not (repeatable or error.errno in NO_ACKNOWLEDGE):
                    raise TransferError(f"{self}: {meaning} (errno {error.errno}, attempt {attempt})") from error
                self._clock.sleep_s(RETRY_PAUSE_S)
            else:
                return


def identify(part: I2cPart, *expected: Identity) -> Identity:
    """Return which of several identities with one register the part has.

    Raises `IdentityError`, which names the part that is found, and `TransferError`.
    """
    found = part.read(expected[0].register, len(expected[0].value))
    for identity in expected:
        if found == identity.value:
            return identity
    other = find_identity(part)
    names = " or ".join(f"{known.name} ({known.value.hex(' ').upper()})" for known in expected)
    raise IdentityError(
        f"{part}: identity reads {found.hex(' ').upper()}, expected is an {names};"
        f" this is {'another part' if other is None else f'an {other.name}'}, name its kind or the right address"
    )


def find_identity(part: I2cPart) -> Identity | None:
    """Return the identity of whatever part is there; None for an unknown one. Raises `TransferError`."""
    possible = (identity for identity in IDENTITIES.values() if part.address in identity.addresses)
    return next((known for known in possible if part.read(known.register, len(known.value)) == known.value), None)


@dataclass(frozen=True, slots=True)
class FoundPart:
    """A part that acknowledges an address."""

    address: int
    identity: Identity | None
    """None: not a known one."""
    error: str | None = None
    """Why its identity could not be read."""


def probe_bus(bus: int, clock: Clock, open_bus: BusOpener = SMBus) -> Iterator[FoundPart]:
    """Yield every part that answers; only identity registers are read. Raises `DeviceNotFoundError`, `DeviceAccessError`."""
    for address in sorted({address for identity in IDENTITIES.values() for address in identity.addresses}):
        part = I2cPart(bus, address, clock, open_bus)
        part.open()
        try:
            yield FoundPart(address, find_identity(part))
        except TransferError as error:
            if set(part.faults) != {"i2c_no_acknowledge"}:
                yield FoundPart(address, None, str(error))
        finally:
            part.close()
