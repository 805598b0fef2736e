"""The register map: every value as a scaled integer, the measured ones also as numbers of 32 bits; high word first."""

import struct

from gateway.bridge.plant_snapshot import PlantSnapshot
from gateway.bridge.plant_values import PLANT_VALUES, PlantValue

NOT_KNOWN = 0x7FFF
"""An integer that is not known, and a register without a value: the largest one with and without a sign. A program that compares
it with a limit finds the limit exceeded; 0x8000 would be far below every limit where it is read with a sign."""
NOT_KNOWN_LONG = 0xFFFF_FFFF
"""The same in two registers."""
FLOAT_WORDS = 2
REGISTERS = 52
"""Length of the map. Definition: one request reads all of it, up to 125 registers, and so all values of one moment."""


def encode_registers(snapshot: PlantSnapshot) -> bytes:
    """Return the content of all input registers, two bytes each, the high one first."""
    content = bytearray(NOT_KNOWN.to_bytes(2, "big") * REGISTERS)
    for value in PLANT_VALUES:
        number = value.number(snapshot)
        _put(content, value.register, _encode_integer(value, number))
        if value.float_register is not None:
            _put(content, value.float_register, struct.pack(">f", float("nan") if number is None else number))
    return bytes(content)


def _put(content: bytearray, register: int, encoded: bytes) -> None:
    content[2 * register : 2 * register + len(encoded)] = encoded


def _encode_integer(value: PlantValue, number: float | int | None) -> bytes:
    unknown = NOT_KNOWN if value.words == 1 else NOT_KNOWN_LONG
    scaled = unknown if number is None else round(number / value.step)
    return scaled.to_bytes(2 * value.words, "big")
