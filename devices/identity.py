"""The identity registers of known parts on an I2C bus, and the addresses at which each part can be.

Addresses collide: an ADXL345 and an ADXL355 share both of theirs. Only the identity tells parts apart.
"""

from dataclasses import dataclass

from devices.errors import IdentityError
from devices.i2c import I2cPart


@dataclass(frozen=True, slots=True)
class Identity:
    """What a part has in its identity registers."""

    name: str
    addresses: tuple[int, ...]
    """The usual one first."""
    register: int
    value: bytes


IDENTITIES = {
    identity.name: identity
    for identity in (
        Identity("ADXL355", (0x1D, 0x53), 0x00, b"\xad\x1d\xed"),  # Rev. D, "Register map"; DEVID_AD, DEVID_MST, PARTID
        Identity("ADXL345", (0x53, 0x1D), 0x00, b"\xe5"),  # Rev. G, register 0x00, DEVID; I2C: ALT ADDRESS pin
    )
}
"""By name. An ADXL357 has the identity of an ADXL355 (data sheet Rev. C, PARTID 0xED)."""


def identify(part: I2cPart, expected: Identity) -> None:
    """Read the identity registers. Raises `IdentityError`, which names the part that is found, and `TransferError`."""
    found = part.read(expected.register, len(expected.value))
    if found == expected.value:
        return
    other = next((known for known in IDENTITIES.values() if _has(part, known)), None)
    raise IdentityError(
        f"{part}: identity reads {found.hex(' ').upper()}, an {expected.name} has {expected.value.hex(' ').upper()};"
        f" this is {'another part' if other is None else f'an {other.name}'}, name its kind or the right address"
    )


def _has(part: I2cPart, identity: Identity) -> bool:
    return part.read(identity.register, len(identity.value)) == identity.value
