"""The section `[device]` of each kind of device."""

from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from pydantic import Field

from gateway.configuration.device_section import DeviceSection
from gateway.configuration.i2c_devices import CHIP_SECTIONS, Ads1115Device
from gateway.configuration.serial_devices import AsppDevice, NodeDevice, WitMotionDevice
from gateway.configuration.single_axis_device import SingleAxisDevice


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
