"""Which known parts are on an I2C bus, by their identities at all addresses at which they can be."""

from collections.abc import Iterator
from dataclasses import dataclass

from smbus2 import SMBus

from devices.accelerometer_chip import Identity
from devices.clock import Clock
from devices.errors import TransferError
from devices.i2c import BusOpener, I2cPart
from devices.identity import IDENTITIES, find_identity

ADDRESSES = sorted({address for identity in IDENTITIES.values() for address in identity.addresses})


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
    for address in ADDRESSES:
        part = I2cPart(bus, address, clock, open_bus)
        part.open()
        try:
            yield FoundPart(address, find_identity(part))
        except TransferError as error:
            if set(part.faults) != {"i2c_no_acknowledge"}:
                yield FoundPart(address, None, str(error))
        finally:
            part.close()
