"""The notation of a text table: what separates its columns, its decimal mark, and where its rows begin."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Literal

from devices.regular_file import open_regular
from devices.tables.layout import Delimiter, TableLayout, plain_row, split_line

HEAD_LINES = 1000
"""Basis: a choice; enough to tell decimal comma, separator and columns."""
HEAD_CHARS = 1 << 20
"""Lines that are looked at. Basis: a choice; lines of a text are shorter, and a binary file is left soon."""
MIN_NUMBERS = 3
"""Fewest numbers in a row of readings. Definition: three axes."""
NOTATIONS: tuple[tuple[Delimiter, Literal[".", ","]], ...] = (
    (",", "."),
    ("\t", "."),
    (";", "."),
    ("\t", ","),
    (";", ","),
    (" ", "."),
    (" ", ","),
)
"""Delimiters with decimal marks, in the order of preference."""


@dataclass(frozen=True, slots=True)
class TableHead:
    """The begin of a table."""

    delimiter: Delimiter
    decimal: Literal[".", ","]
    headers: tuple[tuple[str, ...], ...]
    """Lines above the first row that have as many entries as it; the nearest first."""
    rows: tuple[tuple[str, ...], ...]
    """Rows with at least three numbers and as many entries as the first of them."""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.rows[0]) if self.rows else 0


def read_head(path: Path) -> TableHead:
    """Return the begin of a table. A file that cannot be read has no rows."""
    try:
        with TextIOWrapper(open_regular(path), encoding="utf-8-sig", errors="replace") as file:
            head = file.read(HEAD_CHARS).split("\n", HEAD_LINES)
        lines = [plain_row(line) for line in head[:HEAD_LINES] if line.strip()]
    except OSError:
        lines = []
    return max((_head(lines, *notation) for notation in NOTATIONS), key=_count_numbers)


def _head(lines: Sequence[str], delimiter: Delimiter, decimal: Literal[".", ","]) -> TableHead:
    layout = TableLayout(axes=(1, 2, 3), delimiter=delimiter, decimal=decimal)
    split = [tuple(split_line(line, layout)) for line in lines]
    first = next((place for place, entries in enumerate(split) if _numbers(entries) >= MIN_NUMBERS), None)
    if first is None:
        return TableHead(delimiter, decimal, (), ())
    width = len(split[first])
    rows = tuple(entries for entries in split[first:] if len(entries) == width and _numbers(entries) >= MIN_NUMBERS)
    headers = tuple(entries for entries in reversed(split[:first]) if len(entries) == width)
    return TableHead(delimiter, decimal, headers, rows)


def _count_numbers(head: TableHead) -> int:
    return sum(_numbers(entries) for entries in head.rows)


def _numbers(entries: Sequence[str]) -> int:
    return sum(is_number(entry) for entry in entries)


def is_number(text: str) -> bool:
    """Return whether an entry is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
