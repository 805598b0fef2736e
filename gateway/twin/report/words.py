"""Names, numbers and spans of time as a reader takes them in."""

import math
from collections.abc import Sequence

AXES = ("x", "y", "z")
AXIS_WORDS = {"x": "x, across the rope", "y": "y, across the rope", "z": "z, along the rope"}
MOST_DECIMALS = 9
SMALLEST_P = 0.001
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(name: str) -> str:
    """`wind_gust` as an operator reads it."""
    return name.replace("_", " ")


def listed(names: Sequence[str], last: str = "and") -> str:
    """`a, b and c`, in plain words."""
    words = [plain(name) for name in names]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else "nothing"


def sentence(text: str) -> str:
    """With a capital in front and a full stop behind."""
    text = text.strip()
    return text if not text else text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")


def number(value: float | None, digits: int = 3) -> str:
    """With so many significant digits; what is not there is a dash."""
    if value is None or not math.isfinite(value):
        return "—"
    if value == 0:
        return "0"
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])  # of the rounded value
    if not -5 < exponent < 6:
        return f"{value / 10**exponent:.{digits - 1}f} × 10{str(exponent).translate(SUPERSCRIPTS)}".replace("-", "−")
    return f"{round(value, digits - 1 - exponent):.{max(0, digits - 1 - exponent)}f}".replace("-", "−")


def decade(value: float) -> str:
    """A power of ten on a scale."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    return f"10{str(round(math.log10(value))).translate(SUPERSCRIPTS)}" if value > 0 else ""


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """A value and its interval to two digits of the interval's half-width."""
    half = (high - low) / 2
    if not math.isfinite(half) or half <= 0:
        return number(value, 4), "not determined" if not math.isfinite(half) else "held fixed"
    decimals = min(max(0, 1 - math.floor(math.log10(half))), MOST_DECIMALS)
    shown = [f"{each:.{decimals}f}".replace("-", "−") for each in (value, low, high)]
    return shown[0], f"{shown[1]} to {shown[2]}"


def percent(value: float | None) -> str:
    """One decimal."""
    return "—" if value is None or not math.isfinite(value) else f"{value:.1f} %".replace("-", "−")


def probability(p: float) -> str:
    """p-values below a thousandth say only that."""
    if not math.isfinite(p):
        return "p not known"
    text = f"p < {SMALLEST_P:g}" if p < SMALLEST_P else f"p = {p:.2g}"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def times_noise(chi2: float) -> str:
    """How far the model misses, in units of the noise: the root of the reduced chi-square."""
    return f"{number(math.sqrt(max(chi2, 0.0)))} × noise"


def span(from_s: float, to_s: float) -> str:
    """From when to when; an instant where they are the same."""
    return f"at {from_s:.1f} s" if to_s - from_s < 0.05 else f"{from_s:.1f} s to {to_s:.1f} s"
