"""The section `[device]` of each accelerometer on an I2C bus."""

from typing import ClassVar, Literal

from pydantic import Field, field_validator

from gateway.configuration.device_section import DeviceSection


class I2cDevice(DeviceSection):
    """The keys of every accelerometer on an I2C bus."""

    part: ClassVar[str]
    rates_hz: ClassVar[tuple[float, ...]]

    bus: int = Field(1, ge=0, description="N of /dev/i2c-N")
    address: int
    odr_hz: float
    range_g: int

    @field_validator("odr_hz", check_fields=False)
    @classmethod
    def _check_rate(cls, odr_hz: float) -> float:
        nearest = min(cls.rates_hz, key=lambda rate: abs(rate - odr_hz))
        if abs(nearest - odr_hz) > 1e-3 * nearest:
            raise ValueError(f"the {cls.part} has no rate of {odr_hz:g} Hz; nearest is {nearest:g}")
        return nearest


class Adxl355Device(I2cDevice):
    """Analog Devices ADXL355 over I2C."""

    part: ClassVar[str] = "ADXL355"
    rates_hz: ClassVar[tuple[float, ...]] = tuple(4000.0 / (1 << k) for k in range(11))

    kind: Literal["adxl355"]
    address: int = Field(0x1D, description="0x1D, or 0x53 with the ASEL pin high")
    odr_hz: float = Field(125.0, description="output data rate: 4000 Hz halved up to ten times")
    range_g: Literal[2, 4, 8] = Field(2, description="full scale")


class Adxl357Device(I2cDevice):
    """Analog Devices ADXL357 over I2C: the ADXL355 with larger ranges."""

    part: ClassVar[str] = "ADXL357"
    rates_hz: ClassVar[tuple[float, ...]] = Adxl355Device.rates_hz

    kind: Literal["adxl357"]
    address: int = Field(0x1D, description="0x1D, or 0x53 with the ASEL pin high")
    odr_hz: float = Field(125.0, description="output data rate: 4000 Hz halved up to ten times")
    range_g: Literal[10, 20, 40] = Field(10, description="full scale")


class Adxl345Device(I2cDevice):
    """Analog Devices ADXL345 over I2C."""

    part: ClassVar[str] = "ADXL345"
    rates_hz: ClassVar[tuple[float, ...]] = tuple(800.0 / (1 << k) for k in range(8))

    kind: Literal["adxl345"]
    address: int = Field(0x53, description="0x53, or 0x1D with the ALT ADDRESS pin high")
    odr_hz: float = Field(100.0, description="output data rate: 800 Hz halved up to seven times")
    range_g: Literal[2, 4, 8, 16] = Field(2, description="full scale")
