"""Requests and answers of Modbus TCP (Modbus Application Protocol 1.1b3): one function, the reading of input registers. Pure.

The server of the usual library, pymodbus 3.16, answers the first of several requests in one segment only, stays silent for ever
after one malformed frame, and limits neither connections nor their idleness; its client is the other party of the tests.
"""

import struct

HEADER = struct.Struct(">HHHB")
"""Transaction, protocol (0), number of bytes that follow, unit."""
READ_INPUT_REGISTERS = 4
"""Definition: Modbus Application Protocol 1.1b3, section 6.4."""
MOST_REGISTERS = 125
"""Registers in one answer. Definition: Modbus Application Protocol 1.1b3, section 6.4."""
LONGEST_PDU = 253
"""Bytes of a request behind its unit. Definition: Modbus Application Protocol 1.1b3, section 4.1."""
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
"""Codes of refusals. Definition: Modbus Application Protocol 1.1b3, section 7."""


def request_length(header: bytes) -> int | None:
    """Return the number of bytes that follow the header of a request; None where it is none, and its end is not known."""
    _, protocol, length, _ = HEADER.unpack(header)
    return length - 1 if protocol == 0 and 2 <= length <= LONGEST_PDU + 1 else None


def answer(header: bytes, request: bytes, registers: bytes) -> bytes:
    """Return the answer to a request, whatever it asks for."""
    transaction, protocol, _, unit = HEADER.unpack(header)
    content = _read(request, registers)
    return HEADER.pack(transaction, protocol, len(content) + 1, unit) + content


def _read(request: bytes, registers: bytes) -> bytes:
    function = request[0]
    if function != READ_INPUT_REGISTERS:
        return _refuse(function, ILLEGAL_FUNCTION)
    if len(request) != 5:
        return _refuse(function, ILLEGAL_VALUE)
    first, count = struct.unpack(">HH", request[1:])
    if not 1 <= count <= MOST_REGISTERS:
        return _refuse(function, ILLEGAL_VALUE)
    wanted = registers[2 * first : 2 * (first + count)]
    if len(wanted) != 2 * count:
        return _refuse(function, ILLEGAL_ADDRESS)
    return bytes((function, len(wanted))) + wanted


def _refuse(function: int, code: int) -> bytes:
    return bytes((function | 0x80, code))
