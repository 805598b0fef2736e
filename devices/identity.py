"""The identity registers of known parts on an I2C bus, and the addresses at which each part can be.

Addresses collide: an ADXL345 and an ADXL355 share both of theirs. Only the identity tells parts apart.
"""

from devices.accelerometer_chip import Identity
from devices.chips import CHIPS
from devices.errors import IdentityError
from devices.i2c import I2cPart

IDENTITIES = {
    identity.name: identity
    for identity in (
        *(identity for chip in CHIPS.values() for identity in chip.identities),
        Identity("ADXL359", (0x1D, 0x53), 0x00, b"\xad\x1d\xe9"),  # the registers of an ADXL355; Linux driver adxl355
        Identity("ADS1115", (0x48, 0x49, 0x4A, 0x4B), 0x03, b"\x7f\xff"),  # SBAS444D: it has none; default of Hi_thresh
    )
}
"""By name. An ADXL357 has the identity of an ADXL355 (data sheet Rev. C, PARTID 0xED)."""


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
