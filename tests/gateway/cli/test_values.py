import argparse

import pytest

from gateway.cli.values import above_zero


def test_a_number_above_zero_is_taken() -> None:
    assert above_zero("2.5") == 2.5


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "ten", ""])
def test_anything_else_is_refused_with_what_would_do(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number above 0"):
        above_zero(text)
