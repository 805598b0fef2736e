"""The section `[device]` of sensors and radio receivers on a serial port."""

from typing import Literal

from pydantic import Field

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
