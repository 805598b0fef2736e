"""Sensors on a serial port: cost per sample against the rate of the link, and false frames in noise."""

import time
from collections.abc import Callable

import numpy as np

from devices.serial.aspp import AsppPart
from devices.serial.aspp_frames import AsppDecoder, read_sweeps
from devices.serial.node import NodePart
from devices.serial.node_frames import NodeFrameDecoder
from devices.serial.witmotion import WitMotionPart
from devices.serial.witmotion_frames import FrameDecoder
from devices.serial.witmotion_radio_frames import RadioFrameDecoder
from devices.serial_sensor import SerialPart
from tests.devices.serial.aspp_wire import AsppNode
from tests.devices.serial.node_wire import Node
from tests.devices.serial.witmotion_wire import radio_stream, stream

BAUD = 115200
SAMPLES = 40_000
READ_SAMPLES = 8
ODR_HZ = 100.0
NOISE_MIB = 64
PIECE_BYTES = 4096


def main() -> None:
    """Print the cost of each decoder with its part, and what each accepts of random bytes."""
    print(
        f"serial decoders: CPU per sample, {READ_SAMPLES} samples a read; a link of {BAUD} baud carries {BAUD // 10} bytes/s"
    )
    print("  part              us/sample  bytes/sample  samples/s of the link  % of a core there")
    for name, make, frames, samples in _streams():
        _print_cost(name, make(), frames, samples)
    print(f"noise: {NOISE_MIB} MiB of random bytes, accepted")
    for name, count, unit in _false_frames():
        print(f"  {name:<16} {count:>6} {unit}")


def _streams() -> list[tuple[str, Callable[[], SerialPart], list[bytes], int]]:
    """Return (name, part, frames, samples per frame)."""
    node = {n: Node(per_frame=n) for n in (1, 8)}
    aspp = {version: AsppNode(version=version, per_packet=8, address=7, rate=0) for version in (1, 2, 3)}
    return [
        (
            "witmotion",
            lambda: WitMotionPart(odr_hz=ODR_HZ),
            [stream(range(k % 30000, k % 30000 + 1)) for k in range(SAMPLES)],
            1,
        ),
        (
            "witmotion radio",
            lambda: WitMotionPart(odr_hz=ODR_HZ, frames="radio"),
            [radio_stream(range(k % 30000, k % 30000 + 1)) for k in range(SAMPLES)],
            1,
        ),
        *(
            (
                f"node, {n} a frame",
                lambda: NodePart(node=7, odr_hz=ODR_HZ),
                [node[n].frame() for _ in range(SAMPLES // n)],
                n,
            )
            for n in node
        ),
        *(
            (
                f"aspp {version}, 8 each",
                lambda: AsppPart(node=7, odr_hz=ODR_HZ, range_g=8.0),
                [aspp[version].frame() for _ in range(SAMPLES // 8)],
                8,
            )
            for version in aspp
        ),
    ]


def _print_cost(name: str, part: SerialPart, frames: list[bytes], samples: int) -> None:
    per_read = max(READ_SAMPLES // samples, 1)
    pieces = [b"".join(frames[at : at + per_read]) for at in range(0, len(frames), per_read)]
    read_ns = np.arange(1, len(pieces) + 1) * round(per_read * samples / ODR_HZ * 1e9)
    start_s, count = time.process_time(), 0
    for piece, now_ns in zip(pieces, read_ns.tolist(), strict=True):
        count += sum(len(block) for block in part.feed(piece, now_ns))
    us = (time.process_time() - start_s) / count * 1e6
    bytes_per_sample = sum(map(len, frames)) / count
    link_hz = BAUD / 10 / bytes_per_sample
    print(f"  {name:<16} {us:10.1f} {bytes_per_sample:13.1f} {link_hz:22.0f} {us * link_hz / 1e4:18.1f}")


def _false_frames() -> list[tuple[str, int, str]]:
    standard, radio, node, aspp = FrameDecoder(), RadioFrameDecoder(), NodeFrameDecoder(), AsppDecoder()
    samples = radio_samples = frames = sweeps = 0
    packets = dict.fromkeys((1, 2, 3), 0)
    random = np.random.default_rng(1)
    for _ in range(NOISE_MIB * 256):
        piece = random.integers(0, 256, PIECE_BYTES, dtype=np.uint8).tobytes()
        samples += len(standard.feed(piece))
        radio_samples += len(radio.feed(piece))
        frames += len(node.feed(piece))
        for packet in aspp.feed(piece):
            packets[packet.version] += 1
            sweeps += read_sweeps(packet) is not None
    return [
        ("witmotion", samples, "samples"),
        ("witmotion radio", radio_samples, "samples"),
        ("node", frames, "frames of any node"),
        *((f"aspp {version}", count, "packets of any node and kind") for version, count in packets.items()),
        ("aspp", sweeps, "of them with sweeps of any node"),
    ]
