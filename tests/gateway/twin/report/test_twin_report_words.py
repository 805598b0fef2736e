"""Numbers and names as they are read."""

import math

import pytest

from gateway.twin.report.markup import Html, element, escaped
from gateway.twin.report.words import decade, listed, number, percent, probability, sentence, span, with_interval


@pytest.mark.parametrize(
    ("value", "shown"),
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
def test_numbers(value: float | None, shown: str) -> None:
    assert number(value) == shown


@pytest.mark.parametrize(
    ("value", "low", "high", "shown"),
    [
        (0.0071314, 0.0071219, 0.0071408, ("0.0071314", "0.0071219 to 0.0071408")),
        (36.642, 36.60, 36.68, ("36.642", "36.600 to 36.680")),
        (-1234.5, -1300.0, -1100.0, ("−1234", "−1300 to −1100")),
        (1.5, 1.5, 1.5, ("1.500", "held fixed")),
        (1.5, -math.inf, math.inf, ("1.500", "not determined")),
        (1.5, math.nan, 2.0, ("1.500", "not determined")),
    ],
)
def test_intervals_have_two_digits(value: float, low: float, high: float, shown: tuple[str, str]) -> None:
    assert with_interval(value, low, high) == shown


def test_words() -> None:
    assert listed([]) == "nothing"
    assert listed(["wind_gust"]) == "wind gust"
    assert listed(["wind_gust", "impact", "hoisting"], "or") == "wind gust, impact or hoisting"
    assert sentence("too short; record more") == "Too short; record more."
    assert sentence("  Really?") == "Really?"
    assert (span(3.0, 3.01), span(3.0, 4.0)) == ("at 3.0 s", "3.0 s to 4.0 s")
    assert (percent(99.96), percent(None), percent(-3.0)) == ("100.0 %", "—", "−3.0 %")
    assert (probability(1e-9), probability(0.4219), probability(math.nan)) == (
        "p\xa0<\xa00.001",
        "p\xa0=\xa00.42",
        "p not known",
    )
    assert (decade(0.01), decade(1000.0), decade(1e6), decade(1e-6), decade(0.0)) == ("0.01", "1000", "10⁶", "10⁻⁶", "")


def test_markup_is_escaped_once() -> None:
    assert escaped("<&>\"'") == "&lt;&amp;&gt;&quot;&#x27;"
    assert escaped(Html("<b>")) == "<b>"
    assert element("p", "a < b", element("b", "&"), class_='"') == '<p class="&quot;">a &lt; b<b>&amp;</b></p>'
