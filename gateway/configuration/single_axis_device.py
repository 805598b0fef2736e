"""The section `[device]` of three sensors of which one axis each is used."""

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from devices.i2c.chips import CHIPS
from gateway.configuration.device_section import DeviceSection
from gateway.configuration.section import Section, one_of

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
