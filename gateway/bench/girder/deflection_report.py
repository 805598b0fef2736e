"""The report of a girder's deflection: the largest one with its uncertainty, and the deflection over time."""

from collections.abc import Sequence

from gateway.calibration.record_figure import FigureSeries, RecordFigure
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.documents.format import format_fixed, format_with_uncertainty

MAX_DEFLECTION_POINTS = 2000
"""Points of the figure; more are thinned. Basis: a choice; more than a figure has pixels."""


def render_deflection_report(
    names: tuple[str, str],
    girder_text: str,
    time_s: Sequence[float],
    deflection_mm: Sequence[float],
    u_mm: Sequence[float],
    warnings: Sequence[str],
) -> str:
    """Return the page; the series are of equal length, one at least."""
    place = max(range(len(deflection_mm)), key=lambda number: abs(deflection_mm[number]))
    every = -(-len(time_s) // MAX_DEFLECTION_POINTS)
    series = FigureSeries(
        name="mid-span", x=tuple(time_s[::every]), y=tuple(deflection_mm[::every]), u=tuple(u_mm[::every])
    )
    return render_bench_report(
        "Deflection of a girder",
        facts=(("Left end", names[0]), ("Right end", names[1]), ("Girder", girder_text)),
        tables=(
            ReportTable(
                "Largest deflection at mid-span",
                ("time / s", "deflection / mm"),
                ((format_fixed(time_s[place], 1), format_with_uncertainty(deflection_mm[place], u_mm[place])),),
                "Positive downwards, k = 2, from the rotations of both ends (Zhu et al. 2020, eq. 25). It holds for a girder on "
                "two simple supports and small bending.",
            ),
        ),
        figures=(
            RecordFigure(
                title="Deflection at mid-span",
                x_label="time / s",
                y_label="deflection / mm",
                series=(series,),
                caption="Averages of 1 s; bars: ± 2 u.",
            ),
        ),
        warnings=warnings,
    )
