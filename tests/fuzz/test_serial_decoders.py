"""What the fuzzer checks holds for scripts that hypothesis makes, and for all that the fuzzer has found."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.serial_decoders import LONGEST_PIECE, TARGETS

FINDINGS = Path(__file__).parent / "findings"
STEP = st.tuples(st.integers(0, 255), st.binary(max_size=LONGEST_PIECE - 1)).map(
    lambda step: bytes([step[0], len(step[1])]) + step[1]
)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
@settings(max_examples=150)
@given(script=st.lists(STEP, max_size=30).map(b"".join))
def test_whatever_arrives(target: str, script: bytes) -> None:
    TARGETS[target](script)


@pytest.mark.parametrize("target", TARGETS)
def test_whole_frames_in_order_give_samples(target: str) -> None:
    """The scripts reach the samples: else the checks above would check nothing."""
    steps = []
    for k in range(12):
        tick = 4 * k
        body = {
            "node": bytes([1])
            + tick.to_bytes(4, "little")
            + (40_000 * (k + 1)).to_bytes(8, "little")
            + b"\x01\0\0\0\xff\x7f\x03\0",
            "aspp": b"\x01\x05" + (2 * k).to_bytes(2, "little") + b"\x01" + bytes(24),
        }.get(target, bytes(19))
        steps.append(bytes([4 + 8 * 3, len(body)]) + body)
    assert TARGETS[target](b"".join(steps)) >= 10


def test_what_the_fuzzer_has_found() -> None:
    for path in FINDINGS.glob("*-*"):
        TARGETS[path.name.split("-")[0]](path.read_bytes())
