"""What a WitMotion sensor sends."""

import struct

import numpy as np

from devices.serial.witmotion_frames import Readings

GOLDEN = bytes.fromhex("55 51 00 00 00 00 00 08 C4 09 7B")
NOISE = np.random.default_rng(7).integers(0, 256, 4096, dtype=np.uint8).tobytes()


def frame(id_: int, *words: int) -> bytes:
    head = struct.pack("<BB4h", 0x55, id_, *words)
    return head + bytes([sum(head) & 0xFF])


def sample(number: int) -> bytes:
    """An acceleration frame that carries its own number."""
    return frame(0x51, number, -number, 2048, 2500 + number % 100)


def stream(numbers: range) -> bytes:
    return b"".join(sample(number) for number in numbers)


def cycle(number: int) -> bytes:
    """What a sensor sends by default: acceleration, rate, angle, magnetic field."""
    return sample(number) + b"".join(frame(id_, number, 2, 3, 4) for id_ in (0x52, 0x53, 0x54))


def numbers_of(readings: Readings) -> list[int]:
    numbers: list[int] = readings.counts[:, 0].tolist()
    return numbers


def radio_frame(*words: int) -> bytes:
    """Return a frame of a Bluetooth sensor: acceleration, rate, angle."""
    return struct.pack("<BB9h", 0x55, 0x61, *words)


def radio_sample(number: int) -> bytes:
    """Return a frame that carries its own number."""
    return radio_frame(number, -number, 2048, 100, -200, 300, 1, 2, 3)


def radio_stream(numbers: range) -> bytes:
    return b"".join(radio_sample(number) for number in numbers)


def radio_answer(register: int, *values: int) -> bytes:
    """Return the answer to a request for a register."""
    return struct.pack("<BB9H", 0x55, 0x71, register, *values, *[0] * (8 - len(values)))
