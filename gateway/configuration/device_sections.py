"""The section `[device]` of each kind of device."""

from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field, create_model, field_validator

from devices.i2c.chips import CHIPS, ChipKind
from gateway.configuration.device_section import DeviceSection
from gateway.configuration.section import Section, one_of
from gateway.errors import pattern_of

if TYPE_CHECKING:
    SingleAxisPart = str
else:
    SingleAxisPart = one_of(sorted(kind for kind, chip in CHIPS.items() if not chip.has_gyro))


class SingleAxisSensor(Section):
    """One of the three sensors."""

    part: SingleAxisPart = Field(description="the accelerometer chip")
    bus: int = Field(1, ge=0, description="N of /dev/i2c-N")
    address: int = Field(ge=0x08, le=0x77, description="of the part on its bus")
    range_g: float = Field(2, gt=0, description="full scale")
    sensitive_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = Field(
        description="axis of the part that lies along the combined one; -: the other way"
    )

    @property
    def axis(self) -> tuple[int, int]:
        """Index and sign of the sensitive axis."""
        return "xyz".index(self.sensitive_axis[-1]), -1 if self.sensitive_axis.startswith("-") else 1


class SingleAxisDevice(DeviceSection):
    """Three sensors with one sensitive axis each, combined as one triaxial accelerometer."""

    kind: Literal["single_axis"]
    odr_hz: float = Field(100.0, gt=0, le=4000, description="output data rate, one that all three parts have")
    sensors: list[SingleAxisSensor] = Field(min_length=3, max_length=3, description="those of x, y and z")


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


class SerialSection(DeviceSection):
    """The keys of every sensor on a serial port."""

    port: str = Field(
        pattern=pattern_of(
            "^(/.+|usb:[0-9a-fA-F]{4}:[0-9a-fA-F]{4}(:.+)?)$", "a path such as /dev/ttyUSB0, or usb:VID:PID:SERIAL"
        ),
        description="/dev/serial/by-id/... or usb:VID:PID:SERIAL, the identity of a USB adapter",
    )


class WitMotionDevice(SerialSection):
    """WitMotion sensor or radio receiver on a serial port."""

    kind: Literal["witmotion"]
    baud: int = Field(115200, gt=0, description="as set in the sensor")
    odr_hz: float = Field(100.0, gt=0, le=1000, description="as set in the sensor")
    frames: Literal["standard", "radio"] = Field(
        "standard", description="radio: the 20-byte frames of a Bluetooth Low Energy receiver"
    )


class NodeDevice(SerialSection):
    """Radio node of one's own behind a receiver on a serial port (docs/guides/integrator/node.md)."""

    kind: Literal["node"]
    baud: int = Field(115200, gt=0, description="as set in the receiver")
    node: int = Field(ge=0, lt=2**32, description="number of the node")
    odr_hz: float = Field(100.0, gt=0, le=4000, description="as set in the node")
    range_g: float | None = Field(None, gt=0, description="full scale of the node's sensor, where known")


class AsppDevice(SerialSection):
    """MicroStrain wireless node behind a base station (ASPP); start its sampling with the maker's software."""

    kind: Literal["aspp"]
    baud: int = Field(921600, gt=0, description="of the base station")
    node: int = Field(ge=0, lt=2**32, description="address of the node")
    odr_hz: float = Field(128.0, gt=0, le=8192, description="as set in the node")
    range_g: float = Field(gt=0, description="full scale, as set in the node")
    channels: list[int] = Field([1, 2, 3], min_length=3, max_length=3, description="the node's channels of x, y and z")
    units_per_g: float = Field(
        1.0, gt=0, description="readings per g in the unit that is set in the node; 9.80665 for m/s2"
    )

    @field_validator("channels")
    @classmethod
    def _check_channels(cls, channels: list[int]) -> list[int]:
        if len(set(channels)) < len(channels) or not all(1 <= channel <= 16 for channel in channels):
            raise ValueError(f"channels {channels} must be three different ones from 1 to 16")
        return channels


class SimulatedDevice(DeviceSection):
    """A simulated crane, so that the gateway runs on any computer."""

    kind: Literal["simulated"] = "simulated"
    odr_hz: float = Field(125.0, gt=0, le=4000, description="output data rate")
    range_g: float = Field(2.0, ge=0.1, le=1000, description="full scale")
    seed: int = Field(1, ge=0, description="seed of the crane's moves, the wind and the noise")


class ReplayDevice(DeviceSection):
    """A recording that is processed again by the same pipeline."""

    kind: Literal["replay"]
    path: Path = Field(description=".csv or .mcap")
    speed: float = Field(1.0, ge=0, description="multiple of real time; 0: as fast as possible")
    time_column: str | None = Field(
        None,
        description="foreign text: column of the time by name or 1-based number; NAME:ms (us, ns) if not in seconds",
    )
    axis_columns: list[str] | None = Field(
        None, min_length=3, max_length=3, description="foreign text: names or numbers of the x, y, z columns"
    )
    unit: Literal["g", "mg", "m/s2", "counts"] | None = Field(None, description="foreign text: unit of the axes")
    units_per_g: float | None = Field(None, gt=0, description="foreign text in counts: counts per g")
    rate_hz: float | None = Field(
        None,
        gt=0,
        description="foreign text: sample rate without a column of time, or counts per second of a sample counter",
    )


class IioDevice(DeviceSection):
    """An accelerometer with a driver of the Linux kernel (Industrial I/O)."""

    kind: Literal["iio"]
    name: str = Field(min_length=1, description="its name or label, as in /sys/bus/iio/devices/iio:device0/name")
    mode: Literal["buffer", "polled"] = Field(
        "buffer", description="polled: read the attributes one after another, up to 200 Hz, where there is no buffer"
    )
    odr_hz: float = Field(100.0, gt=0, le=4000, description="output data rate, one of those that the driver offers")
    range_g: float | None = Field(None, gt=0, description="full scale; default: as the driver has set it")
    trigger: str | None = Field(None, description="trigger of the buffer, where the part has no interrupt of its own")


_SECTIONS: tuple[type[DeviceSection], ...] = (
    SimulatedDevice,
    ReplayDevice,
    *CHIP_SECTIONS,
    Ads1115Device,
    IioDevice,
    SingleAxisDevice,
    WitMotionDevice,
    NodeDevice,
    AsppDevice,
)
DEVICE_SECTIONS = {get_args(section.model_fields["kind"].annotation)[0]: section for section in _SECTIONS}
"""By kind."""
if TYPE_CHECKING:
    AnyDevice = DeviceSection
else:
    _Any = reduce(or_, _SECTIONS)
    AnyDevice = Annotated[_Any, Field(discriminator="kind", description="the source of the samples")]
