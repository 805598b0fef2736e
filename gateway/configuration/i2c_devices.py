"""The section `[device]` of each accelerometer on an I2C bus."""

from typing import Any, ClassVar, Literal

from pydantic import Field, create_model, field_validator

from devices.i2c.accelerometer_chip import ChipKind
from devices.i2c.chips import CHIPS
from gateway.configuration.device_section import DeviceSection
from gateway.configuration.section import one_of


class I2cSection(DeviceSection):
    """The keys of every device on an I2C bus."""

    bus: int = Field(1, ge=0, description="N of /dev/i2c-N")
    address: int
    odr_hz: float
    bus_clear_command: list[str] = Field(
        [], description="run when a part holds the bus, such as ['/opt/plumbline/current/deploy/i2c-bus-clear']"
    )
    power_cycle_command: list[str] = Field(
        [], description="run when nothing else has helped: turns the sensor off and on"
    )


class I2cDevice(I2cSection):
    """The keys of every accelerometer chip on an I2C bus."""

    chip: ClassVar[ChipKind]

    range_g: int

    @field_validator("odr_hz", check_fields=False)
    @classmethod
    def _check_rate(cls, odr_hz: float) -> float:
        nearest = min(cls.chip.rates_hz, key=lambda rate: abs(rate - odr_hz))
        if abs(nearest - odr_hz) > 1e-3 * nearest:
            raise ValueError(f"the {cls.chip.part} has no rate of {odr_hz:g} Hz; nearest is {nearest:g}")
        return nearest


def chip_section(chip: ChipKind) -> type[I2cDevice]:
    """Return the section of a kind of chip."""
    address, *_ = chip.identities[0].addresses
    keys: dict[str, Any] = {
        "kind": (one_of([chip.kind]), ...),
        "address": (int, Field(address, description=chip.address_text)),
        "odr_hz": (float, Field(chip.usual_rate_hz, description=f"output data rate: {chip.rates_text}")),
        "range_g": (one_of(chip.ranges_g), Field(chip.ranges_g[0], description="full scale")),
    }
    section = create_model(
        f"{chip.kind.capitalize()}Device", __base__=I2cDevice, __doc__=chip.description, __module__=__name__, **keys
    )
    section.chip = chip
    return section


CHIP_SECTIONS = tuple(map(chip_section, CHIPS.values()))


class Ads1115Device(I2cSection):
    """An analogue accelerometer behind a Texas Instruments ADS1115: x, y, z and its supply at inputs 0 to 3."""

    kind: Literal["ads1115"]
    address: int = Field(0x48, description="0x48 to 0x4B, by the ADDR pin")
    sensor: Literal["ADXL335", "ADXL327", "LIS344ALH"] = Field("ADXL335", description="the analogue accelerometer")
    odr_hz: float = Field(100.0, gt=0, le=125, description="samples per second of all three axes")
