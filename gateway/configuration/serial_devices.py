"""The section `[device]` of sensors and radio receivers on a serial port."""

from typing import Literal

from pydantic import Field, field_validator

from gateway.configuration.device_section import DeviceSection


class SerialSection(DeviceSection):
    """The keys of every sensor on a serial port."""

    port: str = Field(
        pattern="^(/.+|usb:[0-9a-fA-F]{4}:[0-9a-fA-F]{4}(:.+)?)$",
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
    """Radio node of one's own behind a receiver on a serial port (docs/node.md)."""

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
