"""Coverage-guided fuzzing of the sensors on a serial port, by atheris (the dependency group `fuzz`).

    python -m tests.fuzz.serial_decoders aspp -max_total_time=600

The bytes of the fuzzer are a script: pieces of noise, whole frames with any fields, frames with one damaged byte, silence and
time. Each target checks what must hold whatever arrives.
"""

import struct
import sys
from collections.abc import Callable, Iterator

import numpy as np

from devices.errors import DeviceError
from devices.serial.aspp import AsppPart
from devices.serial.aspp_frames import MAX_ASPP_PAYLOAD_BYTES
from devices.serial.node import NodePart
from devices.serial.node_frames import MAX_ENCODED_BYTES, NodeFrame, encode_frame
from devices.serial.witmotion import WitMotionPart
from devices.serial_sensor import SerialPart
from tests.devices.serial import aspp_wire, witmotion_wire

START_NS = 1_700_000_000_000_000_000
LONGEST_PIECE = 64
NODE = 7

Frame = Callable[[bytes], bytes]
"""Make a frame of up to 64 bytes of the fuzzer."""


def check_part(part: SerialPart, frame: Frame, script: bytes) -> int:
    """Feed a part with a script; return the number of samples. Raises `AssertionError` where something does not hold."""
    now_ns, last_ns, count = START_NS, 0, 0
    for data, passed_ns in _steps(frame, script):
        now_ns += passed_ns
        part.request(now_ns)
        assert 1 <= part.bytes_until(8) <= 8 * max(MAX_ENCODED_BYTES, MAX_ASPP_PAYLOAD_BYTES)
        try:
            blocks = part.feed(data, now_ns)
        except DeviceError:
            part.reset()
            continue
        for block in blocks:
            count += len(block)
            assert len(block) == len(block.raw) == len(block.saturated if block.saturated is not None else ())
            assert np.isfinite(block.raw).all()
            assert block.lost >= 0
            assert block.invalid >= 0
            assert block.time_ns[0] > last_ns
            assert (np.diff(block.time_ns) > 0).all()
            last_ns = int(block.time_ns[-1])
        assert all(number >= 0 for number in part.faults.values())
        assert part.bytes_since_frame >= 0
    return count


def _steps(frame: Frame, script: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield bytes, and the time before them in ns; of each step the first byte is what, the second how long."""
    at = 0
    while at + 2 <= len(script):
        kind, size = script[at] % 8, script[at + 1] % LONGEST_PIECE
        passed_ns = (script[at] // 8) ** 3 * 1_000_000  # to 30 s
        body = script[at + 2 : at + 2 + size]
        at += 2 + size
        if kind == 0:
            yield b"", passed_ns
        elif kind == 1:
            yield body, passed_ns
        elif kind == 2:
            whole = frame(body)
            place = len(body) % len(whole)
            yield whole[:place] + bytes([whole[place] ^ (1 << size % 8)]) + whole[place + 1 :], passed_ns
        elif kind == 3:
            whole = frame(body)
            yield whole[: size % len(whole)], passed_ns
        else:
            yield frame(body), passed_ns


def _padded(body: bytes, size: int) -> bytes:
    return body[:size].ljust(size, b"\0")


def node_frame(body: bytes) -> bytes:
    """Return a frame with any fields; most often of the wanted node."""
    boot, sequence, t_us, scale_ng, full_scale, count, other = struct.unpack("<BIQIHBB", _padded(body, 21))
    samples = _padded(body[21:], 6 * (1 + count % 40))
    return encode_frame(
        NodeFrame(
            node=NODE + (other > 250),
            boot=boot,
            sequence=sequence,
            t_us=t_us,
            scale_ng=scale_ng,
            full_scale=full_scale,
            counts=np.frombuffer(samples, "<i2").reshape(-1, 3),
        )
    )


def aspp_packet(body: bytes) -> bytes:
    """Return a packet with any payload, or one of sweeps with any readings."""
    version, kind, tick, choice = struct.unpack("<BBHB", _padded(body, 5))
    version = 1 + version % 3
    kinds = (0x04, 0x0A, 0x0D, 0x11, 0x14, 0x1A, 0x1D)
    if choice % 4 == 0:
        return aspp_wire.packet(version, kinds[kind % 7], NODE + (choice > 250), body[5:])
    readings = np.frombuffer(_padded(body[5:], 12 * (1 + choice % 5)), ">f4").reshape(-1, 3).tolist()
    kind = (0x14, 0x1A)[kind % 2] if version == 3 else kinds[kind % 7]
    return aspp_wire.packet(version, kind, NODE, aspp_wire.sweep_payload(version, kind, tick, readings))


def witmotion_frame(body: bytes) -> bytes:
    """Return a standard frame of any kind, most often of acceleration."""
    kind, *words = struct.unpack("<B4h", _padded(body, 9))
    return witmotion_wire.frame(0x50 + kind % 16 if kind > 128 else 0x51, *words)


def witmotion_radio_frame(body: bytes) -> bytes:
    """Return a frame of readings, or the answer to a request."""
    kind, *words = struct.unpack("<B9h", _padded(body, 19))
    return struct.pack("<BB9h", 0x55, 0x71 if kind > 200 else 0x61, *words)


TARGETS: dict[str, Callable[[bytes], int]] = {
    "aspp": lambda script: check_part(AsppPart(node=NODE, odr_hz=128.0, range_g=8.0), aspp_packet, script),
    "node": lambda script: check_part(NodePart(node=NODE, odr_hz=100.0), node_frame, script),
    "witmotion": lambda script: check_part(WitMotionPart(odr_hz=100.0), witmotion_frame, script),
    "witmotion_radio": lambda script: check_part(
        WitMotionPart(odr_hz=50.0, frames="radio"), witmotion_radio_frame, script
    ),
}


def main() -> None:
    """Fuzz the target that the first argument names; the others are libFuzzer's."""
    import atheris  # noqa: PLC0415  (a group of its own)

    target = TARGETS[sys.argv.pop(1)]

    def run(data: bytes) -> None:
        target(data)

    atheris.instrument_all()
    atheris.Setup(sys.argv, run)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
