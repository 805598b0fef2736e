"""Questions to an archive in SQL, by DuckDB over its tables. Rows that rest on recordings that are not verified are marked."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

import duckdb

from gateway.archive.rows import ALL_TABLES, RECORDINGS, TABLES, schema_of
from gateway.archive.tables import Archive, partition_name
from gateway.errors import InputError

Row = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class QueryAnswer:
    """The rows of an answer."""

    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    is_verified: tuple[bool, ...]
    """Of each row: it is the same without all recordings that are not verified."""
    trust: dict[str, int]
    """Recordings that count, by trust."""


@contextmanager
def open_database(
    archive: Archive, names: Collection[str] = ALL_TABLES.keys(), *, verified_only: bool = False
) -> Iterator[duckdb.DuckDBPyConnection]:
    """Yield a database with one view for each of these tables, of the rows that count. Raises `ArchiveError`.

    It sees nothing but the tables: no other file and no network, whatever the SQL says. A table costs a look into each of its
    files, and the motion has one for each crane and day.
    """
    with duckdb.connect(":memory:") as database:
        database.execute("SET TimeZone = 'UTC'; SET python_enable_replacements = false")
        attached = [name for name in ALL_TABLES if name in {*names, RECORDINGS}]
        files = [file for name in attached for file in _attach(database, archive, name)]
        chosen = "status = 'counted'" + (" AND trust = 'verified'" if verified_only else "")
        database.execute(
            f"CREATE TEMP TABLE counted_recordings AS SELECT DISTINCT recording FROM all_{RECORDINGS} WHERE {chosen}"
        )
        shown = "trust = 'verified'" if verified_only else "true"
        for name in attached:
            rows = "recording IN (FROM counted_recordings)" if name in TABLES else shown
            database.execute(f"CREATE TEMP VIEW {name} AS SELECT * FROM all_{name} WHERE {rows}")
        database.execute("SET allowed_paths = $1", [files])
        database.execute("SET enable_external_access = false; SET lock_configuration = true")
        yield database


def _attach(database: duckdb.DuckDBPyConnection, archive: Archive, name: str) -> list[str]:
    """Make the view of all rows of a table, and return the files that it reads itself.

    DuckDB's own reader of Parquet is four times as fast as the one of Arrow, and has no access to object stores here.
    """
    table = archive.open(name)
    files = list(map(unquote, table.file_uris()))
    if files and "://" not in archive.place:
        database.register(
            f"no_{name}", schema_of(name).empty_table()
        )  # has the columns of this version, in their order
        types = f"{{'crane': VARCHAR, '{partition_name(name)}': VARCHAR}}"
        listed = ", ".join("'" + file.replace("'", "''") + "'" for file in files)
        rows = f"FROM no_{name} UNION ALL BY NAME FROM read_parquet([{listed}], union_by_name=true, hive_types={types})"
    else:
        database.register(f"read_{name}", table.to_pyarrow_dataset())
        files, rows = [], f"FROM read_{name}"
    database.execute(f"CREATE TEMP VIEW all_{name} AS {rows}")
    return files


def ask(archive: Archive, sql: str, *, verified_only: bool = False) -> QueryAnswer:
    """Return the answer to a question, with a mark at each row. Raises `InputError` for SQL that is none, and `ArchiveError`."""
    named = {name for name in ALL_TABLES if name in sql.lower()} or ALL_TABLES.keys()
    return answer(archive, lambda database: _select(database, sql), named, verified_only=verified_only)


Question = Callable[[duckdb.DuckDBPyConnection], tuple[tuple[str, ...], list[Row]]]
"""Returns columns and rows."""


def answer(archive: Archive, question: Question, names: Collection[str], *, verified_only: bool = False) -> QueryAnswer:
    """Put a question to all rows of tables that count, and, where some are not verified, again to those that are."""
    with open_database(archive, names, verified_only=verified_only) as database:
        counts = database.execute(
            f"SELECT trust, count(DISTINCT recording) FROM {RECORDINGS} WHERE status = 'counted' GROUP BY trust ORDER BY trust"
        )
        trust = dict(counts.fetchall())
        columns, rows = question(database)
    if set(trust) <= {"verified"}:
        return QueryAnswer(columns, tuple(rows), (True,) * len(rows), trust)
    with open_database(archive, names, verified_only=True) as database:
        proven = Counter(map(repr, question(database)[1]))
    marks = []
    for row in rows:
        marks.append(proven[repr(row)] > 0)
        proven[repr(row)] -= 1
    return QueryAnswer(columns, tuple(rows), tuple(marks), trust)


def _select(database: duckdb.DuckDBPyConnection, sql: str) -> tuple[tuple[str, ...], list[Row]]:
    try:
        statements = database.extract_statements(sql)
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise InputError(f"{sql!r}: is not one SELECT; ask one question")
        result = database.execute(statements[0])
        return tuple(column[0] for column in result.description or ()), result.fetchall()
    except duckdb.Error as error:
        raise InputError(f"{sql!r}: {str(error).strip().partition(chr(10))[0]}") from error
