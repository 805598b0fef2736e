"""What the fuzzer checks holds for what hypothesis makes, and for all that the fuzzer has found."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.file_parsers import TARGETS

WORDS = st.sampled_from(
    [
        b"time_s,ax_g,ay_g,az_g\n0,0,0,1\n",
        b"[device]\n",
        b'kind = "adxl355"\n',
        b"[rope]\nlength_m = ",
        b"[housing]\nposition_m = 1\n",
        b'{"id": "a", "by": "b"',
        b"NaN",
        b"1e999",
        b"9" * 5000,
        b'"\\ud800"',
        b"[" * 2000,
        b"\xff\xfe",
        b"boot 1 {}\n",
        b"boot " + b"9" * 5000 + b" {}\n",
        json.dumps({"format": 1, "session": None, "answers": []}).encode(),
        json.dumps({"newest_segment": 10**30}).encode(),
    ]
)
PIECES = st.lists(st.one_of(WORDS, st.binary(max_size=40)), max_size=12).map(b"".join)


FOUND = {"mcap": [b"\x01\x00\x00A\x89MCAP0\r\n"]}
"""Inputs that had ended in a traceback: an MCAP file that is too short for a footer and ends like one."""


@pytest.mark.parametrize("target", FOUND)
def test_what_the_fuzzer_has_found(target: str) -> None:
    for content in FOUND[target]:
        TARGETS[target](content)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@settings(max_examples=120)
@given(content=PIECES)
def test_whatever_a_file_contains(target: str, content: bytes) -> None:
    TARGETS[target](content)
