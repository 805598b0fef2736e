"""Numbers as a certificate gives them: as many digits as the expanded uncertainty bears, which has two."""

import math

COVERAGE_FACTOR = 2.0
"""k: about 95 % of a normal distribution (GUM 6.3)."""
MOST_DECIMALS = 9
LARGEST_WRITTEN_OUT = 1e9
UNKNOWN = "—"


def with_u(value: float, u_value: float) -> str:
    """Value and expanded uncertainty (k = 2) from a standard uncertainty: `12.3 ± 1.1`."""
    expanded = COVERAGE_FACTOR * u_value
    if not math.isfinite(value):
        return UNKNOWN
    if not math.isfinite(expanded) or expanded <= 0:
        return f"{value:.6g}"
    decimals = 1 - math.floor(math.log10(expanded))
    if decimals > MOST_DECIMALS or abs(value) >= LARGEST_WRITTEN_OUT or expanded >= LARGEST_WRITTEN_OUT:
        return f"{value:.6g} ± {expanded:.2g}"
    return f"{fixed(value, decimals)} ± {fixed(expanded, decimals)}"


def fixed(value: float, decimals: int) -> str:
    """A number to so many decimals, to tens or hundreds where they are negative; zero has no sign."""
    rounded = round(value, decimals) + 0.0
    return f"{rounded:.{max(decimals, 0)}f}"


def significant(value: float | None, digits: int = 3) -> str:
    """A number with a few digits; a dash where there is none."""
    return UNKNOWN if value is None or not math.isfinite(value) else f"{value:.{digits}g}"
