"""The known parts on an I2C bus: the kinds of accelerometer chips, which their modules declare, and their identities.

Configuration, search and self-test follow from the table of kinds. Addresses collide: an ADXL345 and an ADXL355 share both of
theirs. Only the identity registers tell parts apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from smbus2 import SMBus

from devices.clock import Clock
from devices.errors import IdentityError, TransferError
from devices.i2c.accelerometer_chip import ChipKind, Identity
from devices.i2c.adxl345 import ADXL345_KIND
from devices.i2c.adxl355 import ADXL355_KIND, ADXL357_KIND
from devices.i2c.bus import BusOpener, I2cPart
from devices.i2c.lis2dw12 import LIS2DW12_KIND
from devices.i2c.lis3dh import LIS3DH_KIND
from devices.i2c.mpu9250 import MPU6050_KIND, MPU9250_KIND

CHIPS: dict[str, ChipKind] = {
    chip.kind: chip
    for chip in (
        ADXL355_KIND,
        ADXL357_KIND,
        ADXL345_KIND,
        LIS3DH_KIND,
        LIS2DW12_KIND,
        MPU9250_KIND,
        MPU6050_KIND,
    )
}
"""By the kind that a configuration names."""


IDENTITIES = {
    identity.name: identity
    for identity in (
        *(identity for chip in CHIPS.values() for identity in chip.identities),
        Identity("ADXL359", (0x1D, 0x53), 0x00, b"\xad\x1d\xe9"),  # the registers of an ADXL355; Linux driver adxl355
        Identity("ADS1115", (0x48, 0x49, 0x4A, 0x4B), 0x03, b"\x7f\xff"),  # SBAS444D: it has none; default of Hi_thresh
    )
}
"""By name. An ADXL357 has the identity of an ADXL355 (data sheet Rev. C, PARTID 0xED)."""
ADDRESSES = sorted({address for identity in IDENTITIES.values() for address in identity.addresses})


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
