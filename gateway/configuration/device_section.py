"""The keys that every kind of device has."""

from pydantic import Field, field_validator

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
    def _check_handedness(cls, text: str) -> str:
        axes = [axis.strip() for axis in text.split(",")]
        if sorted(axis.lstrip("+-") for axis in axes) != ["x", "y", "z"]:
            raise ValueError(f"axes_map {text!r} must name x, y and z once each, such as '-y,x,z'")
        if _determinant(axes) < 0:
            raise ValueError(f"axes_map {text!r} is left-handed (a mirror image); turn one sign")
        return ",".join(axes)

    @property
    def axes(self) -> tuple[tuple[int, int], ...]:
        """(sensor axis index, sign) of each housing axis."""
        return tuple(("xyz".index(axis[-1]), -1 if axis.startswith("-") else 1) for axis in self.axes_map.split(","))


def _determinant(axes: list[str]) -> int:
    order = ["xyz".index(axis[-1]) for axis in axes]
    even = order in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
    negative = sum(axis.startswith("-") for axis in axes) % 2
    return (1 if even else -1) * (-1 if negative else 1)
