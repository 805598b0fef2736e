"""The Delta tables of an archive, and the exchange of the rows of recordings in them, once whatever happens meanwhile.

Each table is a folder of Parquet files with a log of transactions. A writer names its gateways in each transaction: one
that another writer of one of them has overtaken fails, and is computed again from what is there then.
"""

from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from datetime import datetime
from itertools import starmap
from typing import Any

import pyarrow as pa
from deltalake import CommitProperties, DeltaTable, Field, QueryBuilder, Transaction, WriterProperties, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from gateway.archive.rows import ALL_TABLES, NAMES, RECORDINGS, RESULTS, IndexedFile, RecordingRow, schema_of
from gateway.archive.source import reason_of_store
from gateway.errors import InputError

MAX_ATTEMPTS = 50
"""Attempts of a transaction that others overtake. Basis: a choice; each time one of them has got on, so that some suffice for as
many writers of one gateway."""
NOT_IN_NAMES = frozenset('%[]{}?*#<>|^"\\')
"""Characters that mean something in URLs or patterns of files."""
NO_GATEWAY = "(none)"
"""The writer of files of which nobody knows whose they are."""
COMPRESSION = WriterProperties(compression="ZSTD")


class ArchiveError(InputError):
    """A table cannot be read or written; the text names it and the mend."""


class NoTableError(ArchiveError):
    """A table is not there."""


@dataclass(frozen=True, slots=True)
class Archive:
    """The tables below a folder, or below a URL such as `s3://bucket/archive`, with the settings of the environment."""

    place: str
    _opened: dict[str, DeltaTable] = field(default_factory=dict, compare=False, repr=False)
    """Of a table with thousands of transactions, the new ones alone are read then."""

    def __post_init__(self) -> None:
        """Raise `ArchiveError` for a name that the libraries of the tables do not take."""
        if wrong := NOT_IN_NAMES & set(self.place):
            raise ArchiveError(f"{self.place}: has {' '.join(sorted(wrong))} in its name; choose one without")

    def create(self) -> None:
        """Make the tables that are missing, and add columns that this version has and they have not. Raises `ArchiveError`."""
        for name in ALL_TABLES:
            table = self._open_or_create(name)
            known = set(pa.schema(table.schema()).names)
            if missing := [column for column in schema_of(name) if column.name not in known]:
                table.alter.add_columns([Field.from_arrow(column) for column in missing])

    def _open_or_create(self, name: str) -> DeltaTable:
        for _ in range(MAX_ATTEMPTS):
            try:
                return self.open(name)
            except NoTableError:
                self._create(name)
        raise ArchiveError(f"{self._place(name)}: cannot be made; choose another place")

    def _create(self, name: str) -> None:
        try:
            DeltaTable.create(
                self._place(name),
                schema_of(name),
                mode="ignore",
                partition_by=["crane", partition_name(name)],
            )
        except CommitFailedError:  # another one has made it
            pass
        except (DeltaError, OSError, ValueError) as error:
            raise ArchiveError(
                f"{self._place(name)}: cannot be made ({reason_of_store(error)}); choose another place"
            ) from error

    def open(self, name: str) -> DeltaTable:
        """Return a table as it is now. Raises `ArchiveError`."""
        try:
            if name in self._opened:
                self._opened[name].update_incremental()
            else:
                self._opened[name] = DeltaTable(self._place(name))
        except TableNotFoundError as error:
            raise NoTableError(f"{self.place}: has no table {name}; make it with plumbline archive index") from error
        except (DeltaError, OSError) as error:
            raise ArchiveError(f"{self._place(name)}: cannot be read ({reason_of_store(error)})") from error
        return self._opened[name]

    def files(self, table: DeltaTable, writers: Collection[str] | None = None) -> list[IndexedFile]:
        """Return the files that a table of recordings knows; where gateways are given, those of their cranes."""
        chosen = "true" if writers is None else sql_in("crane", _cranes(writers))
        return [indexed_file(row) for row in select(table, "*", chosen).to_pylist()]

    def exchange(self, name: str, places: "Places", rows: pa.Table) -> None:
        """Put rows in place of others in one transaction; another writer of the same gateways makes it begin again."""
        for _ in range(MAX_ATTEMPTS):
            if self.replace(self.open(name), places, rows):
                return
        raise ArchiveError(f"{self._place(name)}: others are writing all the time; try again later")

    def replace(self, table: DeltaTable, places: "Places", rows: pa.Table) -> bool:
        """Put rows in place of others in one transaction; return whether nobody has overtaken it."""
        is_taken = bool(places.predicate and select(table, places.column, f"{places.predicate} LIMIT 1").num_rows)
        if not is_taken and not rows.num_rows:
            return True
        numbers = {writer: (table.transaction_version(writer) or 0) + 1 for writer in sorted(places.writers)}
        settings: dict[str, Any] = {
            "commit_properties": CommitProperties(app_transactions=list(starmap(Transaction, numbers.items()))),
            "writer_properties": COMPRESSION,
        }
        try:
            if is_taken:
                write_deltalake(table, rows, mode="overwrite", predicate=places.predicate, **settings)
            else:
                write_deltalake(table, rows, mode="append", **settings)
        except CommitFailedError:
            return False
        except (DeltaError, OSError) as error:
            raise ArchiveError(f"{table.table_uri}: cannot be written ({reason_of_store(error)})") from error
        return True

    def compact(self) -> None:
        """Join small files, and delete those that have not been part of a table for a week. Raises `ArchiveError`.

        Where others write meanwhile, a table stays as it is until the next time.
        """
        for name in ALL_TABLES:
            table = self.open(name)
            try:
                with suppress(CommitFailedError):
                    table.optimize.compact(writer_properties=COMPRESSION)
                table.vacuum(dry_run=False)
            except (DeltaError, OSError) as error:
                raise ArchiveError(f"{table.table_uri}: cannot be compacted ({reason_of_store(error)})") from error

    def _place(self, name: str) -> str:
        return f"{self.place.rstrip('/')}/{name}"


@dataclass(frozen=True, slots=True)
class Places:
    """Rows that are replaced, and the gateways that are written."""

    writers: frozenset[str]
    column: str
    """By which the rows are known."""
    predicate: str = ""
    """In SQL; empty: none are replaced."""


def row_places(name: str, writers: Iterable[str], values: Sequence[str], partitions: Sequence[str | None]) -> Places:
    """Return the rows of files, of tasks, or of the recordings with these hashes, in partitions of the gateways' cranes."""
    written = frozenset(writers)
    column = {RECORDINGS: "path", RESULTS: "task"}.get(name, "recording")
    if not values:
        return Places(written, column)
    conditions = (sql_in("crane", _cranes(written)), sql_in(partition_name(name), partitions), sql_in(column, values))
    return Places(written, column, " AND ".join(conditions))


def select(table: DeltaTable, columns: str, condition: str) -> pa.Table:
    """Return columns of the rows of a table for which a condition in SQL holds. Raises `ArchiveError`."""
    try:
        found = QueryBuilder().register("rows", table).execute(f"SELECT {columns} FROM rows WHERE {condition}")
        return pa.table(found.read_all())
    except (DeltaError, OSError) as error:
        raise ArchiveError(f"{table.table_uri}: cannot be read ({reason_of_store(error)})") from error


def _cranes(writers: Iterable[str]) -> list[str | None]:
    return [None if writer == NO_GATEWAY else writer.split("/")[1] for writer in writers]


def sql_in(column: str, values: Collection[str | None]) -> str:
    """Return whether a column has one of the values, in SQL, in which nothing is equal to NULL."""
    known = sorted({value for value in values if value is not None})
    listed = f"{column} IN ({', '.join(map(_text, known))})" if known else "false"
    return f"({listed} OR {column} IS NULL)" if None in values else listed


def _text(value: str) -> str:
    """Return a text as SQL has it."""
    return "'" + value.replace("'", "''") + "'"


def partition_name(name: str) -> str:
    """Return the column by which a table is divided, beside the crane."""
    return ALL_TABLES[name].partition


def partition_of(name: str, file: IndexedFile) -> str | None:
    """Return the partition of the rows of a file: the day or the month in which it begins, UTC; None without a gateway."""
    if file.gateway is None:
        return None
    day = f"{pa.scalar(file.utc_ns // 1000, pa.timestamp('us', tz='UTC')).as_py():%Y-%m-%d}"
    return day if ALL_TABLES[name].partition == "from_day" else day[:7]


def table_of(name: str, rows: Sequence[Any], file: IndexedFile, wall_offset_ns: int) -> pa.Table:
    """Return rows of a recording as a table of the archive."""
    schema, spec = schema_of(name), ALL_TABLES[name]
    site, crane, sensor = file.gateway or (None, None, None)
    count = len(rows)
    columns: dict[str, list[Any]] = {
        field.name: [getattr(row, field.name) for row in rows] for field in fields(spec.row)
    }
    columns["utc"] = [time_ns + wall_offset_ns for time_ns in columns["gateway_time_ns"]]
    constant = {"site": site, "crane": crane, "sensor": sensor, "recording": file.recording, "trust": file.trust}
    constant[spec.partition] = partition_of(name, file)
    columns |= {key: [value] * count for key, value in constant.items()}
    return pa.table([_array(columns[field.name], field.type) for field in schema], schema=schema)


def without_names(name: str, rows: pa.Table) -> pa.Table:
    """Return rows of a table with its column that may name people empty."""
    if name not in NAMES:
        return rows
    column = rows.schema.get_field_index(NAMES[name])
    return rows.set_column(
        column, rows.schema.field(column), pa.array([""] * len(rows), rows.schema.field(column).type)
    )


def _array(values: list[Any], kind: pa.DataType) -> pa.Array:
    if pa.types.is_timestamp(kind):
        values = [None if value is None else value // 1000 for value in values]
    return pa.array(values, kind)


def recordings_table(files: Sequence[IndexedFile]) -> pa.Table:
    """Return files as rows of the table of recordings."""
    tables = [table_of(RECORDINGS, [file.row], file, file.utc_ns - file.row.gateway_time_ns) for file in files]
    return pa.concat_tables(tables) if tables else schema_of(RECORDINGS).empty_table()


def indexed_file(row: dict[str, Any]) -> IndexedFile:
    """Return the file of a row of the table of recordings."""
    gateway = None if row["crane"] is None else (row["site"], row["crane"], row["sensor"])
    # an older table lacks columns
    own: dict[str, Any] = {field.name: row.get(field.name) for field in fields(RecordingRow)}
    own["end_utc"] = _ns(own["end_utc"])
    return IndexedFile(gateway, row["recording"], row["trust"], _ns(row["utc"]), RecordingRow(**own))


def _ns(time: datetime) -> int:
    return round(time.timestamp() * 1_000_000) * 1000
