"""Numbers, names and sentences as a document prints them."""

import math

import pytest

from gateway.documents.format import (
    as_sentence,
    format_decade,
    format_fixed,
    format_limit,
    format_number,
    format_p_value,
    format_percent,
    format_short,
    format_time_span,
    format_with_interval,
    format_with_uncertainty,
    human_name,
    join_names,
    printable_text,
)


@pytest.mark.parametrize(
    ("value", "u_value", "printed"),
    [
        (1.476512, 0.00017, "1.47651 ± 0.00034"),
        (-12.3456, 0.55, "−12.3 ± 1.1"),
        (8087.24, 73.0, "8090 ± 150"),
        (-0.001, 0.8, "0.0 ± 1.6"),
        (261152.0, 5.0, "261152 ± 10"),
        (5.0, 0.0, "5"),
        (1.0, float("nan"), "1"),
        (float("nan"), 1.0, "—"),
        (3.2e12, 1.0e10, "3.2e+12 ± 2e+10"),
        (1e-12, 1e-14, "1e-12 ± 2e-14"),
    ],
)
def test_value_gets_two_digits_of_its_expanded_uncertainty(value: float, u_value: float, printed: str) -> None:
    assert format_with_uncertainty(value, u_value) == printed


def test_short_numbers_have_no_trailing_zeros() -> None:
    shown = [format_short(value) for value in (None, float("inf"), 0.0, 0.012345, 2.0, -1.5)]
    assert shown == ["—", "—", "0", "0.0123", "2", "−1.5"]


@pytest.mark.parametrize(
    ("value", "printed"),
    [
        (0.9997, "1.00"),
        (0.00714, "0.00714"),
        (232.4, "232"),
        (12345.0, "12300"),
        (-0.5, "−0.500"),
        (1.234e7, "1.23 × 10⁷"),
        (-2e-7, "−2.00 × 10⁻⁷"),
        (0.0, "0"),
        (math.nan, "—"),
        (math.inf, "—"),
        (None, "—"),
    ],
)
def test_numbers_have_three_significant_digits(value: float | None, printed: str) -> None:
    assert format_number(value) == printed


@pytest.mark.parametrize(
    ("value", "low", "high", "printed"),
    [
        (0.0071314, 0.0071219, 0.0071408, ("0.0071314", "0.0071219 to 0.0071408")),
        (36.642, 36.60, 36.68, ("36.642", "36.600 to 36.680")),
        (-1234.5, -1300.0, -1100.0, ("−1234", "−1300 to −1100")),
        (1.5, 1.5, 1.5, ("1.500", "held fixed")),
        (1.5, -math.inf, math.inf, ("1.500", "not determined")),
        (1.5, math.nan, 2.0, ("1.500", "not determined")),
    ],
)
def test_interval_gets_two_digits_of_its_half_width(
    value: float, low: float, high: float, printed: tuple[str, str]
) -> None:
    assert format_with_interval(value, low, high) == printed


def test_percentages_probabilities_times_and_decades() -> None:
    assert (format_percent(99.96), format_percent(None), format_percent(-3.0)) == ("100.0 %", "—", "−3.0 %")
    assert (format_p_value(1e-9), format_p_value(0.4219), format_p_value(math.nan)) == (
        "p\xa0<\xa00.001",
        "p\xa0=\xa00.42",
        "p not known",
    )
    assert (format_time_span(3.0, 3.01), format_time_span(3.0, 4.0)) == ("at 3.0 s", "3.0 s to 4.0 s")
    decades = [format_decade(value) for value in (0.01, 1000.0, 1e6, 1e-6, 0.0)]
    assert decades == ["0.01", "1000", "10⁶", "10⁻⁶", ""]


def test_names_are_joined_as_words() -> None:
    assert human_name("wind_gust") == "wind gust"
    assert join_names([]) == "nothing"
    assert join_names(["wind_gust"]) == "wind gust"
    assert join_names(["wind_gust", "impact", "hoisting"], "or") == "wind gust, impact or hoisting"


def test_sentences_start_with_a_capital_and_end_with_a_stop() -> None:
    assert as_sentence("too short; record more") == "Too short; record more."
    assert as_sentence("  Really?") == "Really?"
    assert as_sentence("") == ""


def test_text_of_unknown_origin_is_printable_and_bounded() -> None:
    assert printable_text("a\x00b\u202ec", 10) == "a\ufffdb\ufffdc"
    assert printable_text("abcdef", 4) == "abc…"
    assert printable_text("abcd", 4) == "abcd"


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(5.05, 1, "5.1"), (4.5, 0, "5"), (-0.25, 1, "−0.3"), (-0.04, 1, "0.0"), (1250.0, -2, "1300"), (5.0499, 1, "5.0")],
)
def test_a_half_is_rounded_away_from_zero(value: float, decimals: int, text: str) -> None:
    assert format_fixed(value, decimals) == text


@pytest.mark.parametrize(("value", "text"), [(5.0, "5.0"), (5.25, "5.25"), (5, "5.0"), (0.1, "0.1")])
def test_a_limit_is_printed_exactly(value: float, text: str) -> None:
    assert format_limit(value) == text
