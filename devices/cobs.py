"""Consistent overhead byte stuffing: bytes without a zero, so that a zero can delimit frames (Cheshire and Baker 1999)."""

LONGEST_RUN = 254
"""Number of bytes without a zero that one code byte can announce."""


def cobs_encode(data: bytes) -> bytes:
    """Return the data without zeros, without the delimiter."""
    encoded = bytearray()
    runs = data.split(b"\0")
    for index, run in enumerate(runs):
        for start in range(0, max(len(run), 1), LONGEST_RUN):
            part = run[start : start + LONGEST_RUN]
            encoded.append(len(part) + 1)
            encoded += part
        if run and len(run) % LONGEST_RUN == 0 and index < len(runs) - 1:
            encoded.append(1)  # a code of 255 announces no zero; this one does
    return bytes(encoded)


def cobs_decode(encoded: bytes) -> bytes:
    """Return the data. Raises `ValueError` for a code that points beyond the end, and for a zero."""
    if 0 in encoded:
        raise ValueError("a zero within a frame")
    data, at = bytearray(), 0
    while at < len(encoded):
        code = encoded[at]
        if at + code > len(encoded):
            raise ValueError("a code byte points beyond the end of the frame")
        data += encoded[at + 1 : at + code]
        at += code
        if code <= LONGEST_RUN and at < len(encoded):
            data.append(0)
    return bytes(data)
