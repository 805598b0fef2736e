"""The output of `plumbline calibrate thermal`: coefficients with intervals, limits, verdicts by axis, and the record's figure."""

from collections.abc import Sequence

import numpy as np

from devices.conversion import force_g, zero_g_output
from gateway.bench.thermal.ramp import Ramp
from gateway.bench.thermal.ramp_calibration import AxisSummary, MeasuredCoefficient, ThermalCalibration, Verdict
from gateway.calibration.pose import FACES
from gateway.calibration.record import FigureSeries, RecordFigure
from gateway.documents.format import format_fixed
from gateway.numerics.array import Array
from gateway.numerics.stats import means_by_group

N_POINTS = 20
"""Number of temperatures of a series. Basis: a choice; a line or a parabola needs fewer."""


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
    return text + limit + (", with a square" if found.is_quadratic else "") + f"; mostly {found.dominated_by}"


def _verdict(verdict: Verdict | None) -> str:
    return "" if verdict is None else f" ({verdict})"


def thermal_figure(found: ThermalCalibration) -> RecordFigure:
    """Return half sums of opposite faces against temperature (Sawicki and Walendziuk 2016, eq. 8 and Figure 7), in mg."""
    low_c, high_c = found.range_c
    grid_c = low_c + (np.arange(N_POINTS) + 0.5) / N_POINTS * (high_c - low_c)
    series = []
    for axis, entry in enumerate(found.summary):
        up, down = (_mean_reading(found.ramps, face, axis, grid_c) for face in FACES[2 * axis : 2 * axis + 2])
        change_mg = 1000 * force_g(zero_g_output(up, down), entry.zero_g, entry.sensitivity)
        series.append(
            FigureSeries(name=entry.axis, x=tuple(grid_c.tolist()), y=tuple(change_mg.tolist()), u=(0.0,) * N_POINTS)
        )
    offset = ", ".join(f"{entry.axis} {format_fixed(entry.offset_mg_per_c.value, 3)}" for entry in found.summary)
    sensitivity = ", ".join(
        f"{entry.axis} {format_fixed(entry.sensitivity_percent_per_c.value, 4)}" for entry in found.summary
    )
    verdicts = ", ".join(f"{entry.axis} {entry.verdict}" for entry in found.summary if entry.verdict is not None)
    return RecordFigure(
        title="Zero-g offset against temperature",
        x_label="temperature / °C",
        y_label="change of the offset / mg",
        series=tuple(series),
        caption=f"Mean slopes: offset {offset} mg/°C; sensitivity {sensitivity} %/°C. The gateway corrects for both."
        + (f" Against the data sheet: {verdicts}." if verdicts else ""),
    )


def _mean_reading(ramps: Sequence[Ramp], face: str, axis: int, grid_c: Array) -> Array:
    step_c = grid_c[1] - grid_c[0]
    curves = []
    for ramp in ramps:
        if ramp.face == face:
            near = np.abs(np.subtract.outer(ramp.temperature_c, grid_c))
            inside = near.min(axis=1) <= step_c / 2
            columns = np.column_stack([ramp.temperature_c, ramp.mean[:, axis]])[inside]
            means, _ = means_by_group(near[inside].argmin(axis=1), columns)
            curves.append(np.interp(grid_c, *means.T))
    return np.asarray(np.mean(curves, axis=0))
