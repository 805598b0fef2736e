"""The report of a measurement on the bench or over a fleet, as one self-contained HTML page: facts, tables and figures."""

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.calibration.record import RecordFigure
from gateway.certificate.plots import plot_figure
from gateway.documents.environment import render
from gateway.documents.figures import Figure
from gateway.documents.format import printable_text

MAX_CELL_CHARACTERS = 200
"""Characters of a cell. Basis: a choice; three lines of a column, and no page of hostile text."""


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table with its title."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def render_bench_report(
    title: str,
    *,
    facts: Sequence[tuple[str, str]] = (),
    tables: Sequence[ReportTable] = (),
    figures: Sequence[RecordFigure] = (),
    drawings: Sequence[Figure] = (),
    warnings: Sequence[str] = (),
) -> str:
    """Return the page; texts of unknown origin are bounded and escaped, a figure that cannot be plotted is left out.

    `drawings` are figures that are drawn already; they stand before the tables.
    """
    plots = [plot for plot in map(plot_figure, figures) if plot is not None]
    return render(
        "bench_report.html.j2",
        title=printable_text(title, MAX_CELL_CHARACTERS),
        facts=[(name, printable_text(value, MAX_CELL_CHARACTERS)) for name, value in facts],
        tables=[_bounded(table) for table in tables],
        plots=plots,
        drawings=drawings,
        warnings=[printable_text(text, MAX_CELL_CHARACTERS) for text in warnings],
    )


def _bounded(table: ReportTable) -> ReportTable:
    rows = tuple(tuple(printable_text(cell, MAX_CELL_CHARACTERS) for cell in row) for row in table.rows)
    return ReportTable(table.title, table.header, rows, table.note)
