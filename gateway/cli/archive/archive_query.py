"""`plumbline archive query`: a question to the tables in SQL."""

import argparse
from datetime import date, datetime
from typing import TYPE_CHECKING, Any

from gateway.cli.archive.archive_options import add_table
from gateway.cli.command import command, option
from gateway.cli.terminal.output import add_json
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.archive.query import QueryAnswer

NOT_VERIFIED = "*"


@command(
    "query",
    "put a question in SQL to the tables",
    "Put a question in SQL to the tables of an archive: recordings, swings, motion, minutes, alerts, conditions, "
    "health, calibrations, clock. Only rows that count are seen. A row of the answer that would be another one without the "
    "recordings that are not verified is marked *.",
    "example: plumbline archive query 'SELECT crane, max(phi_max_deg) FROM swings GROUP BY 1' --table /srv/archive",
    option("sql", metavar="SQL", help="one SELECT, in the dialect of DuckDB"),
    add_table,
    option("--verified", action="store_true", help="leave out recordings that are not verified"),
    add_json,
)
def run_query(arguments: argparse.Namespace) -> int:
    """Print the answer."""
    require_extra("archive")
    from gateway.archive.query import ask
    from gateway.archive.tables import Archive
    from gateway.cli.terminal.output import show

    answer = ask(Archive(arguments.table), arguments.sql, verified_only=arguments.verified)
    show(_text(answer), _as_json(answer), arguments.json)
    return 0


def _text(answer: "QueryAnswer") -> str:
    cells = [[" ", *answer.columns]]
    for row, is_verified in zip(answer.rows, answer.is_verified, strict=True):
        cells.append(
            [" " if is_verified else NOT_VERIFIED, *("" if each is None else str(_plain(each)) for each in row)]
        )
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [" ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]
    trust = ", ".join(f"{count} {name}" for name, count in answer.trust.items()) or "no recordings"
    marked = sum(not each for each in answer.is_verified)
    note = f"; {NOT_VERIFIED} rests on recordings that are not verified ({marked} rows)" if marked else ""
    return "\n".join([*lines, f"{len(answer.rows)} rows from {trust}{note}"])


def _as_json(answer: "QueryAnswer") -> dict[str, Any]:
    return {
        "columns": list(answer.columns),
        "rows": [[_plain(each) for each in row] for row in answer.rows],
        "is_verified": list(answer.is_verified),
        "recordings": answer.trust,
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON has it."""
    if isinstance(value, datetime | date):
        return value.isoformat()
    return value if isinstance(value, str | int | float | bool | None) else str(value)
