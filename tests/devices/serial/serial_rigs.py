"""Every kind of sensor on a serial port, with what it sends: for tests that concern all of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from devices.block import SampleBlock
from devices.clock import Clock
from devices.serial.aspp import open_aspp
from devices.serial.node import open_node
from devices.serial.witmotion import open_witmotion
from devices.serial_sensor import SerialSensor
from tests.devices.serial import aspp_wire, node_wire
from tests.devices.serial.witmotion_wire import radio_sample, sample

ODR_HZ = 100.0
PER_FRAME = 2
"""Samples in a frame, where a frame has more than one."""


@dataclass(frozen=True)
class SerialRig:
    """A kind of sensor. A sample carries its own number, from 0 on, modulo 30000."""

    name: str
    open: Callable[[str, Clock], SerialSensor]
    frames: Callable[[int], list[bytes]]
    """Return that many frames, from the first one on."""
    samples: int
    """In a frame."""
    numbered: bool
    """Frames have numbers: lost ones are counted exactly, repeated ones are dropped."""
    checksum: bool = True
    also_lost: int = 0
    """The frame beside a cut one that is lost, too: the next (1) or the one before (-1)."""
    end: bytes = b""
    """What has to follow the last frame, so that it is used."""

    def __str__(self) -> str:
        return self.name

    def numbers(self, block: SampleBlock) -> list[int]:
        """Return the numbers of the samples of a block."""
        scale = {"node": node_wire.SCALE_NG * 1e-9, "aspp": 1e-3}.get(self.name.split("_")[0], 1.0)
        numbers: list[int] = np.rint(block.raw[:, 0] / scale).astype(int).tolist()
        return numbers


def _node_frames(count: int) -> list[bytes]:
    node = node_wire.Node(per_frame=PER_FRAME)
    return [node.frame() for _ in range(count)]


def _aspp_packets(version: int) -> Callable[[int], list[bytes]]:
    def packets(count: int) -> list[bytes]:
        node = aspp_wire.AsppNode(version=version, per_packet=PER_FRAME, address=7, rate=0)
        return [node.frame() for _ in range(count)]

    return packets


def _open_aspp(port: str, clock: Clock) -> SerialSensor:
    return open_aspp(port, 115200, node=7, clock=clock, range_g=8.0, odr_hz=ODR_HZ)


RIGS = (
    SerialRig(
        "witmotion",
        lambda port, clock: open_witmotion(port, clock=clock, odr_hz=ODR_HZ, block_samples=2),
        lambda count: [sample(number) for number in range(count)],
        samples=1,
        numbered=False,
    ),
    SerialRig(
        "witmotion_radio",
        lambda port, clock: open_witmotion(port, clock=clock, odr_hz=ODR_HZ, frames="radio", block_samples=2),
        lambda count: [radio_sample(number) for number in range(count)],
        samples=1,
        numbered=False,
        checksum=False,
        also_lost=-1,
        end=b"\x55\x61",
    ),
    SerialRig(
        "node",
        lambda port, clock: open_node(port, node=7, clock=clock, odr_hz=ODR_HZ, block_samples=2),
        _node_frames,
        samples=PER_FRAME,
        numbered=True,
        also_lost=1,
    ),
    *(
        SerialRig(f"aspp_{version}", _open_aspp, _aspp_packets(version), samples=PER_FRAME, numbered=True)
        for version in (1, 2, 3)
    ),
)
