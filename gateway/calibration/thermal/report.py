"""The text output of `plumbline calibrate thermal`: coefficients with intervals, limits and verdicts by axis."""

from collections.abc import Sequence

from gateway.calibration.thermal.datasheet_limits import Verdict
from gateway.calibration.thermal.ramp_calibration import AxisSummary, MeasuredCoefficient


def format_thermal(summary: Sequence[AxisSummary], part: str | None, range_c: tuple[float, float], unit: str) -> str:
    """Return the table of the axes as several lines of text."""
    against = (
        "no limits given: --part, or --limit-offset and --limit-sensitivity" if part is None else f"limits of {part}"
    )
    lines = [f"thermal coefficients over {range_c[0]:.1f} to {range_c[1]:.1f} °C, 95 % intervals; {against}"]
    for entry in summary:
        lines += [
            f"  {entry.axis}  offset       {_coefficient(entry.offset_mg_per_c, 'mg/°C', 3)}",
            f"     sensitivity  {_coefficient(entry.sensitivity_percent_per_c, '%/°C', 4)}",
            f"     at the reference: zero g {entry.zero_g:.6g} {unit}{_verdict(entry.zero_g_verdict)}, "
            f"{entry.sensitivity:.6g} {unit}/g{_verdict(entry.sensitivity_verdict)}",
        ]
        if entry.verdict is not None:
            lines.append(f"     verdict: {entry.verdict}")
    return "\n".join(lines)


def _coefficient(found: MeasuredCoefficient, unit: str, decimals: int) -> str:
    low, high = found.ci95
    text = f"{found.value:+.{decimals}f} {unit} [{low:+.{decimals}f}, {high:+.{decimals}f}]"
    limit = "" if found.limit is None else f", limit +-{found.limit:g}: {found.verdict}"
    return text + limit + (", with a square" if found.is_quadratic else "")


def _verdict(verdict: Verdict | None) -> str:
    return "" if verdict is None else f" ({verdict})"
