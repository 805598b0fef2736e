import argparse

import pytest

from gateway.cli.argument_types import above_zero, key_fingerprint, recording_time, whole_number


def test_a_number_above_zero_is_accepted() -> None:
    assert above_zero("2.5") == 2.5


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "ten", ""])
def test_other_values_are_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number above 0"):
        above_zero(text)


def test_only_whole_numbers_are_accepted() -> None:
    assert whole_number("0") == 0
    for text in ("-1", "1.5", "²", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="is not a whole number from 0"):
            whole_number(text)


def test_other_texts_are_refused_with_the_forms_of_a_time() -> None:
    assert recording_time("1:30").value_ns == 90 * 10**9
    with pytest.raises(argparse.ArgumentTypeError, match=r"soon is neither seconds from the start .* nor UTC"):
        recording_time("soon")


def test_a_fingerprint_has_the_form_that_the_gateway_prints() -> None:
    assert key_fingerprint("2693-bcf2-69b1-0e1d") == "2693-bcf2-69b1-0e1d"
    for text in ("zz", "2693bcf269b10e1d", "2693-BCF2-69B1-0E1D", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="is not a fingerprint"):
            key_fingerprint(text)
