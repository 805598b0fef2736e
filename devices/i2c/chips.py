"""The accelerometer chips that are known on an I2C bus: their identities, and what a configuration may choose.

Configuration, search and self-test follow from the table of kinds. The driver of a kind, its registers and decoding, is imported
when one is made. Addresses collide: an ADXL345 and an ADXL355 share both of theirs. Only the identity registers tell parts apart.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from devices.i2c.accelerometer_chip import AccelerometerChip

MAX_LISTED_RATES = 16
"""Rates that an error lists one by one. Basis: a choice; one line of a terminal."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What a part has in its identity registers."""

    name: str
    addresses: tuple[int, ...]
    """The usual one first."""
    register: int
    value: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class ChipKind:
    """A kind of chip: its identities, and what a configuration may choose."""

    part: str
    """As its maker writes it."""
    description: str
    driver: str
    """Module in `devices.i2c` and its class, which takes the kind, a rate and a range of it."""
    identities: tuple[Identity, ...]
    address_text: str
    rates_hz: tuple[float, ...]
    rates_text: str
    usual_rate_hz: float = 100.0
    ranges_g: tuple[int, ...] = (2, 4, 8, 16)
    """The usual one first."""
    has_gyro: bool = False

    @property
    def kind(self) -> str:
        """As a configuration names it."""
        return self.part.lower().replace("-", "")

    def __call__(self, odr_hz: float, range_g: float) -> "AccelerometerChip":
        """Return a chip at a rate and a range. Raises `ValueError` for one that it does not have."""
        module, name = self.driver.split(":")
        make: Callable[[ChipKind, float, int], AccelerometerChip] = getattr(
            import_module(f"devices.i2c.{module}"), name
        )
        return make(self, self._nearest_rate(odr_hz), self._known_range(range_g))

    def _nearest_rate(self, odr_hz: float) -> float:
        """Return the rate that equals `odr_hz` within 0.1 %. Raises `ValueError` with all rates if there is none."""
        rate_hz = min(self.rates_hz, key=lambda rate_hz: abs(rate_hz - odr_hz))
        if not math.isclose(rate_hz, odr_hz, rel_tol=1e-3):
            few = len(self.rates_hz) <= MAX_LISTED_RATES
            known = "it has " + ", ".join(f"{rate:g}" for rate in self.rates_hz) if few else f"nearest is {rate_hz:g}"
            raise ValueError(f"the {self.part} has no output data rate of {odr_hz:g} Hz; {known}")
        return rate_hz

    def _known_range(self, range_g: float) -> int:
        """Return the range as a whole number. Raises `ValueError` with all ranges if the chip does not have it."""
        if range_g not in self.ranges_g:
            *others, last = map(str, self.ranges_g)
            raise ValueError(f"the {self.part} has no range of {range_g:g} g; it has {', '.join(others)} and {last}")
        return int(range_g)


ADXL355_KIND = ChipKind(
    part="ADXL355",
    description="Analog Devices ADXL355 over I2C.",
    driver="adxl355:Adxl355",
    identities=(Identity("ADXL355", (0x1D, 0x53), 0x00, b"\xad\x1d\xed"),),  # Rev. D: DEVID_AD, DEVID_MST, PARTID
    address_text="0x1D, or 0x53 with the ASEL pin high",
    rates_hz=tuple(4000.0 / (1 << k) for k in range(11)),
    rates_text="4000 Hz halved up to ten times",
    usual_rate_hz=125.0,
    ranges_g=(2, 4, 8),
)
"""Basis: of its usual rate a choice, the one next to the 100 Hz of the other chips."""
ADXL357_KIND = replace(
    ADXL355_KIND,
    part="ADXL357",
    description="Analog Devices ADXL357 over I2C: the ADXL355 with larger ranges.",
    ranges_g=(10, 20, 40),
)
"""It has the identity of an ADXL355 (data sheet Rev. C, PARTID 0xED)."""
ADXL345_KIND = ChipKind(
    part="ADXL345",
    description="Analog Devices ADXL345 over I2C.",
    driver="adxl345:Adxl345",
    identities=(Identity("ADXL345", (0x53, 0x1D), 0x00, b"\xe5"),),  # Rev. G, DEVID; pin ALT ADDRESS
    address_text="0x53, or 0x1D with the ALT ADDRESS pin high",
    rates_hz=tuple(800.0 / (1 << k) for k in range(8)),
    rates_text="800 Hz halved up to seven times",
)
"""800 Hz is the fastest rate for an I2C bus of 400 kHz (section "I2C"). Basis: data sheet."""
LIS3DH_KIND = ChipKind(
    part="LIS3DH",
    description="STMicroelectronics LIS3DH over I2C.",
    driver="lis3dh:Lis3dh",
    identities=(Identity("LIS3DH", (0x18, 0x19), 0x0F, b"\x33"),),  # Rev. 2, section 8.6, WHO_AM_I; pin SA0
    address_text="0x18, or 0x19 with the SA0 pin high",
    rates_hz=(1344.0, 400.0, 200.0, 100.0, 50.0, 25.0, 10.0, 1.0),
    rates_text="1, 10, 25, 50, 100, 200, 400 or 1344 Hz",
)
"""Rates in high-resolution mode (Table 31). Basis: data sheet."""
LIS2DW12_KIND = ChipKind(
    part="LIS2DW12",
    description="STMicroelectronics LIS2DW12 over I2C.",
    driver="lis2dw12:Lis2dw12",
    identities=(Identity("LIS2DW12", (0x18, 0x19), 0x0F, b"\x44"),),  # Rev. 8, section 8.3, WHO_AM_I; pin SA0
    address_text="0x18, or 0x19 with the SA0 pin high",
    rates_hz=tuple(1600.0 / (1 << k) for k in range(8)),
    rates_text="1600 Hz halved up to seven times",
)
"""Rates in high-performance mode (section 8.4, CTRL1). Basis: data sheet."""
MPU9250_KIND = ChipKind(
    part="MPU-9250",
    description="InvenSense MPU-9250, MPU-9255 or MPU-6500 over I2C.",
    driver="mpu9250:Mpu9250",
    identities=(
        Identity("MPU-9250", (0x68, 0x69), 0x75, b"\x71"),  # RM-MPU-9250A-00 Rev. 1.6, section 4.38, WHOAMI; pin AD0
        Identity("MPU-9255", (0x68, 0x69), 0x75, b"\x73"),  # RM-MPU-9255 Rev. 1.0, WHOAMI
        Identity("MPU-6500", (0x68, 0x69), 0x75, b"\x70"),  # the accelerometer and gyroscope of the MPU-9250
    ),
    address_text="0x68, or 0x69 with the AD0 pin high",
    rates_hz=tuple(1000.0 / (1 + divider) for divider in range(256)),
    rates_text="1000 Hz divided by 1 to 256",
    has_gyro=True,
)
MPU6050_KIND = replace(
    MPU9250_KIND,
    part="MPU-6050",
    description="InvenSense MPU-6050 over I2C.",
    identities=(Identity("MPU-6050", (0x68, 0x69), 0x75, b"\x68"),),  # RM-MPU-6000A-00 Rev. 4.2, section 4.32, WHO_AM_I
)
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
"""By name."""
