"""Numbers, names and sentences as a document prints them.

A number has the digits that its uncertainty supports, a true minus sign, and a dash where none is known.
"""

import math
from collections.abc import Sequence
from decimal import ROUND_HALF_UP, Decimal

COVERAGE_FACTOR = 2.0
"""k: about 95 % of a normal distribution (GUM 6.3)."""
MAX_DECIMALS = 9
"""Basis: a choice; a billionth of a unit is below any result."""
MAX_WRITTEN_OUT = 1e9
"""Basis: a choice; ten digits are still read."""
MIN_STATED_P = 0.001
"""Basis: a choice; the tail of a smaller probability is not known so well."""
INSTANT_S = 0.05
"""A shorter span of time is printed as an instant. Basis: a choice; it would be printed as 0.0 s."""
UNKNOWN = "—"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
ELLIPSIS = "…"
REPLACEMENT = "\ufffd"


def format_number(value: float | None, digits: int = 3) -> str:
    """Return a number with exactly so many significant digits."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    if value == 0:
        return "0"
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])  # of the rounded value
    if not -5 < exponent < 6:
        return _minus(f"{value / 10**exponent:.{digits - 1}f} × {power_of_ten(exponent)}")
    return _minus(f"{round(value, digits - 1 - exponent):.{max(0, digits - 1 - exponent)}f}")


def format_short(value: float | None, digits: int = 3) -> str:
    """Return a number with at most so many significant digits, without trailing zeros."""
    return UNKNOWN if value is None or not math.isfinite(value) else _minus(f"{value:.{digits}g}")


def format_fixed(value: float, decimals: int) -> str:
    """Return a number to so many decimals, to tens or hundreds where they are negative; zero has no sign.

    A number that ends in a half is rounded away from zero, as people round what they read: 5.05 is 5.1.
    """
    if not math.isfinite(value):
        return _minus(f"{value}")
    written = Decimal(repr(float(value)))
    rounded = float(written.quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)) + 0.0
    return _minus(f"{rounded:.{max(decimals, 0)}f}")


def format_limit(value: float) -> str:
    """Return a limit that a person has set, exactly, with one decimal at least: `5.0`, `5.25`."""
    return _minus(f"{value:.1f}" if value == round(value, 1) else f"{value:g}")


def format_with_uncertainty(value: float, u_value: float) -> str:
    """Return value and expanded uncertainty (k = 2) from a standard uncertainty, which gets two digits: `12.3 ± 1.1`."""
    expanded = COVERAGE_FACTOR * u_value
    if not math.isfinite(value):
        return UNKNOWN
    if not math.isfinite(expanded) or expanded <= 0:
        return _minus(f"{value:.6g}")
    decimals = 1 - math.floor(math.log10(expanded))
    if decimals > MAX_DECIMALS or abs(value) >= MAX_WRITTEN_OUT or expanded >= MAX_WRITTEN_OUT:
        return _minus(f"{value:.6g} ± {expanded:.2g}")
    return f"{format_fixed(value, decimals)} ± {format_fixed(expanded, decimals)}"


def format_with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """Return a value and its interval, to two digits of the interval's half-width."""
    half = (high - low) / 2
    if not math.isfinite(half) or half <= 0:
        return format_number(value, 4), "not determined" if not math.isfinite(half) else "held fixed"
    decimals = min(max(0, 1 - math.floor(math.log10(half))), MAX_DECIMALS)
    shown = [_minus(f"{each:.{decimals}f}") for each in (value, low, high)]
    return shown[0], f"{shown[1]} to {shown[2]}"


def format_percent(value: float | None) -> str:
    """Return a percentage to one decimal."""
    return UNKNOWN if value is None or not math.isfinite(value) else _minus(f"{value:.1f} %")


def format_p_value(p: float) -> str:
    """Return `p = 0.42`, or `p < 0.001` below a thousandth, without a line break inside."""
    if not math.isfinite(p):
        return "p not known"
    text = f"p < {MIN_STATED_P:g}" if p < MIN_STATED_P else f"p = {p:.2g}"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def format_time_span(from_s: float, to_s: float) -> str:
    """Return `3.0 s to 4.0 s`, or `at 3.0 s` for an instant."""
    return f"at {from_s:.1f} s" if to_s - from_s < INSTANT_S else f"{from_s:.1f} s to {to_s:.1f} s"


def format_decade(value: float) -> str:
    """Return a power of ten as the label of a logarithmic scale."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    return power_of_ten(round(math.log10(value))) if value > 0 else ""


def power_of_ten(exponent: int) -> str:
    """Return `10⁻⁶`."""
    return f"10{str(exponent).translate(SUPERSCRIPTS)}"


def _minus(number: str) -> str:
    """Return a number with a true minus sign in front."""
    return f"−{number[1:]}" if number.startswith("-") else number


def printable_text(text: str, limit: int) -> str:
    """Return text of unknown origin with at most `limit` characters; those that cannot be printed are replaced."""
    seen = "".join(character if character.isprintable() else REPLACEMENT for character in text[: limit + 1])
    return seen if len(seen) <= limit else f"{seen[: limit - 1]}{ELLIPSIS}"


def human_name(name: str) -> str:
    """Return an identifier such as `wind_gust` as words."""
    return name.replace("_", " ")


def join_names(names: Sequence[str], last: str = "and") -> str:
    """Return identifiers as words in a row: `a, b and c`."""
    words = [human_name(name) for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else "nothing"


def as_sentence(text: str) -> str:
    """Return text with a capital at the front and a full stop at the end."""
    text = text.strip()
    return text if not text else text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")
