"""Byte stuffing: the examples of its authors, and every other content."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.serial.node_frames import cobs_decode, cobs_encode

UP_TO_254 = bytes(range(1, 255))


@pytest.mark.parametrize(
    ("data", "encoded"),
    [  # Cheshire and Baker 1999, and the table of examples that is in common use
        (b"\x00", "01 01"),
        (b"\x00\x00", "01 01 01"),
        (b"\x00\x11\x00", "01 02 11 01"),
        (b"\x11\x22\x00\x33", "03 11 22 02 33"),
        (b"\x11\x22\x33\x44", "05 11 22 33 44"),
        (b"\x11\x00\x00\x00", "02 11 01 01 01"),
        (UP_TO_254, "FF" + UP_TO_254.hex()),
        (b"\x00" + UP_TO_254, "01 FF" + UP_TO_254.hex()),
        (UP_TO_254 + b"\xff", "FF" + UP_TO_254.hex() + "02 FF"),
        (UP_TO_254 + b"\x00", "FF" + UP_TO_254.hex() + "01 01"),
        (UP_TO_254[1:] + b"\xff\x00", "FF" + UP_TO_254[1:].hex() + "FF 01 01"),
    ],
)
def test_examples(data: bytes, encoded: str) -> None:
    assert cobs_encode(data) == bytes.fromhex(encoded)
    assert cobs_decode(bytes.fromhex(encoded)) == data


@pytest.mark.slow
@given(st.one_of(st.binary(), st.lists(st.sampled_from([0, 1]), max_size=800).map(bytes)))
def test_any_data_come_back_without_a_zero_between(data: bytes) -> None:
    encoded = cobs_encode(data)
    assert 0 not in encoded
    assert len(encoded) <= len(data) + len(data) // 254 + 1
    assert cobs_decode(encoded) == data


@pytest.mark.parametrize("wrong", [b"\x03\x11", b"\x02\x00", b"\x00"])
def test_bytes_that_nobody_encoded_are_refused(wrong: bytes) -> None:
    with pytest.raises(ValueError, match=r"zero within|beyond the end"):
        cobs_decode(wrong)
