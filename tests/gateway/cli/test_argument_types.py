import argparse

import pytest

from gateway.cli.argument_types import above_zero, whole_number


def test_a_number_above_zero_is_taken() -> None:
    assert above_zero("2.5") == 2.5


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "ten", ""])
def test_anything_else_is_refused_with_what_would_do(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number above 0"):
        above_zero(text)


def test_a_whole_number_is_taken_and_anything_else_refused() -> None:
    assert whole_number("0") == 0
    for text in ("-1", "1.5", "²", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="is not a whole number from 0"):
            whole_number(text)
