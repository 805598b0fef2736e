"""The keys that every kind of device has."""

from pydantic import Field, field_validator

from devices.axes_map import AxesMap, parse_axes_map
from gateway.configuration.section import KEY_PATTERN, Section


class DeviceSection(Section):
    """The keys that every kind of device has."""

    kind: str
    axes_map: str = Field("x,y,z", description="sensor axes that are the housing's x, y and z, e.g. '-y,x,z'")
    block_samples: int | None = Field(
        None, ge=1, le=1024, description="samples per block; default: those of 0.1 s, at most 32"
    )
    serial: str | None = Field(
        None, pattern=KEY_PATTERN, description="label on the housing, for sensors without a serial number"
    )

    @field_validator("axes_map")
    @classmethod
    def _check_axes_map(cls, text: str) -> str:
        try:
            parse_axes_map(text)
        except ValueError as error:
            raise ValueError(f"axes_map {error}") from error
        return ",".join(axis.strip() for axis in text.split(","))

    @property
    def axes(self) -> AxesMap:
        """(sensor axis index, sign) of each housing axis."""
        return parse_axes_map(self.axes_map)
