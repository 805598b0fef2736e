"""The uncertainty budget (GUM 5 and 8): contributions, combined, expanded."""

import math
from dataclasses import dataclass

from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import COVERAGE_FACTOR, format_short
from gateway.documents.text import printable_text

MOST_ROWS = 7
SOURCE = 36
NEGLIGIBLE = 1e-6
"""mg or degrees: digits below say nothing."""


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """A contribution, or a sum of contributions."""

    source: str
    type: str
    u_mg: str
    u_deg: str


@dataclass(frozen=True, slots=True)
class BudgetView:
    """The budget as it is printed."""

    rows: tuple[BudgetRow, ...]
    """The largest first where there are more than fit."""
    hidden: int
    """Contributions that do not fit; the sums include them."""
    sums: tuple[BudgetRow, ...]
    """Combined and expanded uncertainty; root of the sum of squares of all contributions."""


def budget_view(record: CalibrationRecord) -> BudgetView:
    """Return the rows of the record's budget and their sums; no rows where the record has no budget."""
    rows = record.budget
    if len(rows) > MOST_ROWS:
        rows = sorted(rows, key=lambda row: row.u_g, reverse=True)[:MOST_ROWS]
    combined_g = math.hypot(*(row.u_g for row in record.budget))
    combined_deg = math.hypot(*(row.u_deg for row in record.budget))
    return BudgetView(
        rows=tuple(_row(printable_text(row.source, SOURCE), row.type, row.u_g, row.u_deg) for row in rows),
        hidden=len(record.budget) - len(rows),
        sums=(
            _row("combined, u", "", combined_g, combined_deg),
            _row("expanded, U (k = 2)", "", COVERAGE_FACTOR * combined_g, COVERAGE_FACTOR * combined_deg),
        ),
    )


def _row(source: str, type_: str, u_g: float, u_deg: float) -> BudgetRow:
    return BudgetRow(source, type_, _figure(1000 * u_g), _figure(u_deg))


def _figure(value: float) -> str:
    return f"< {NEGLIGIBLE:g}" if 0 < value < NEGLIGIBLE else format_short(value)
