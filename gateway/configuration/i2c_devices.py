"""The section `[device]` of each accelerometer on an I2C bus."""

from typing import ClassVar, Literal

from pydantic import Field, field_validator

from gateway.configuration.device_section import DeviceSection


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

    part: ClassVar[str]
    rates_hz: ClassVar[tuple[float, ...]]

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


class Lis3dhDevice(I2cDevice):
    """STMicroelectronics LIS3DH over I2C."""

    part: ClassVar[str] = "LIS3DH"
    rates_hz: ClassVar[tuple[float, ...]] = (1.0, 10.0, 25.0, 50.0, 100.0, 200.0, 400.0, 1344.0)

    kind: Literal["lis3dh"]
    address: int = Field(0x18, description="0x18, or 0x19 with the SA0 pin high")
    odr_hz: float = Field(100.0, description="output data rate: 1, 10, 25, 50, 100, 200, 400 or 1344 Hz")
    range_g: Literal[2, 4, 8, 16] = Field(2, description="full scale")


class Lis2dw12Device(I2cDevice):
    """STMicroelectronics LIS2DW12 over I2C."""

    part: ClassVar[str] = "LIS2DW12"
    rates_hz: ClassVar[tuple[float, ...]] = tuple(1600.0 / (1 << k) for k in range(8))

    kind: Literal["lis2dw12"]
    address: int = Field(0x18, description="0x18, or 0x19 with the SA0 pin high")
    odr_hz: float = Field(100.0, description="output data rate: 1600 Hz halved up to seven times")
    range_g: Literal[2, 4, 8, 16] = Field(2, description="full scale")


class Mpu9250Device(I2cDevice):
    """InvenSense MPU-9250, MPU-9255 or MPU-6500 over I2C."""

    part: ClassVar[str] = "MPU-9250"
    rates_hz: ClassVar[tuple[float, ...]] = tuple(1000.0 / (1 + divider) for divider in range(256))

    kind: Literal["mpu9250"]
    address: int = Field(0x68, description="0x68, or 0x69 with the AD0 pin high")
    odr_hz: float = Field(100.0, description="output data rate: 1000 Hz divided by 1 to 256")
    range_g: Literal[2, 4, 8, 16] = Field(2, description="full scale")


class Mpu6050Device(I2cDevice):
    """InvenSense MPU-6050 over I2C."""

    part: ClassVar[str] = "MPU-6050"
    rates_hz: ClassVar[tuple[float, ...]] = Mpu9250Device.rates_hz

    kind: Literal["mpu6050"]
    address: int = Field(0x68, description="0x68, or 0x69 with the AD0 pin high")
    odr_hz: float = Field(100.0, description="output data rate: 1000 Hz divided by 1 to 256")
    range_g: Literal[2, 4, 8, 16] = Field(2, description="full scale")


class Ads1115Device(I2cSection):
    """An analogue accelerometer behind a Texas Instruments ADS1115: x, y, z and its supply at inputs 0 to 3."""

    kind: Literal["ads1115"]
    address: int = Field(0x48, description="0x48 to 0x4B, by the ADDR pin")
    sensor: Literal["ADXL335", "ADXL327", "LIS344ALH"] = Field("ADXL335", description="the analogue accelerometer")
    odr_hz: float = Field(100.0, gt=0, le=125, description="samples per second of all three axes")
