"""The Delta tables of an archive, and the exchange of the rows of recordings in them, once whatever happens meanwhile.

Each table is a folder of Parquet files with a log of transactions. A writer names the gateway in each transaction: one that
another writer of the same gateway has overtaken fails, and is computed again from what is there then.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime
from functools import reduce
from operator import and_
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
from deltalake import CommitProperties, DeltaTable, Field, Transaction, WriterProperties, write_deltalake
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from gateway.archive.rows import ALL_TABLES, RECORDINGS, RESULTS, RecordingRow, schema_of
from gateway.archive.versions import IndexedFile
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


@dataclass(frozen=True, slots=True)
class Archive:
    """The tables below a folder, or below a URL such as `s3://bucket/archive`."""

    place: str
    options: dict[str, str] = field(default_factory=dict)
    """Settings of the object store, beside those of the environment."""

    def __post_init__(self) -> None:
        """Raise `ArchiveError` for a name that the libraries of the tables do not take."""
        if wrong := NOT_IN_NAMES & set(self.place):
            raise ArchiveError(f"{self.place}: has {' '.join(sorted(wrong))} in its name; choose one without")

    def create(self) -> None:
        """Make the tables that are missing, and add columns that this version has and they have not. Raises `ArchiveError`."""
        for name in ALL_TABLES:
            self._create(name)
            table = self.open(name)
            known = set(pa.schema(table.schema()).names)
            if missing := [column for column in schema_of(name) if column.name not in known]:
                table.alter.add_columns([Field.from_arrow(column) for column in missing])

    def _create(self, name: str) -> None:
        for attempt in range(MAX_ATTEMPTS):
            try:
                DeltaTable.create(
                    self._place(name),
                    schema_of(name),
                    mode="ignore",
                    partition_by=["crane", ALL_TABLES[name].partition],
                    storage_options=self.options,
                )
            except (DeltaError, OSError, ValueError) as error:
                if attempt == MAX_ATTEMPTS - 1 or not isinstance(error, CommitFailedError):  # another one has made it
                    raise ArchiveError(
                        f"{self._place(name)}: cannot be made ({_reason(error)}); choose another place"
                    ) from error
            else:
                return

    def open(self, name: str) -> DeltaTable:
        """Return a table as it is now. Raises `ArchiveError`."""
        try:
            return DeltaTable(self._place(name), storage_options=self.options)
        except TableNotFoundError as error:
            raise ArchiveError(f"{self.place}: has no table {name}; make it with plumbline archive index") from error
        except (DeltaError, OSError) as error:
            raise ArchiveError(f"{self._place(name)}: cannot be read ({_reason(error)})") from error

    def files(self, table: DeltaTable, writer: str | None = None) -> list[IndexedFile]:
        """Return the files that a table of recordings knows; of one writer, where it is given."""
        chosen = None
        if writer == NO_GATEWAY:
            chosen = ds.field("crane").is_null()
        elif writer is not None:
            parts = zip(("site", "crane", "sensor"), writer.split("/"), strict=True)
            chosen = reduce(and_, (ds.field(name) == value for name, value in parts))
        return [_indexed(row) for row in table.to_pyarrow_dataset().to_table(filter=chosen).to_pylist()]

    def exchange(self, name: str, writer: str, places: "Places", rows: pa.Table) -> None:
        """Put rows in place of others in one transaction; another writer of the same gateway makes it begin again."""
        for _ in range(MAX_ATTEMPTS):
            if self.replace(self.open(name), writer, places, rows):
                return
        raise ArchiveError(f"{self._place(name)}: others are writing all the time; try again later")

    def replace(self, table: DeltaTable, writer: str, places: "Places", rows: pa.Table) -> bool:
        """Put rows in place of others in one transaction; return whether nobody has overtaken it."""
        taken = table.to_pyarrow_dataset().count_rows(filter=places.expression) if places.predicate else 0
        if not taken and not rows.num_rows:
            return True
        number = (table.transaction_version(writer) or 0) + 1
        settings: dict[str, Any] = {
            "commit_properties": CommitProperties(app_transactions=[Transaction(writer, number)]),
            "writer_properties": COMPRESSION,
            "storage_options": self.options,
        }
        try:
            if taken:
                write_deltalake(table, rows, mode="overwrite", predicate=places.predicate, **settings)
            else:
                write_deltalake(table, rows, mode="append", **settings)
        except CommitFailedError:
            return False
        except (DeltaError, OSError) as error:
            raise ArchiveError(f"{table.table_uri}: cannot be written ({_reason(error)})") from error
        return True

    def _place(self, name: str) -> str:
        return f"{self.place.rstrip('/')}/{name}"


@dataclass(frozen=True, slots=True)
class Places:
    """Rows that are replaced, in SQL for the transaction and as a filter to find them."""

    predicate: str
    expression: ds.Expression | None


def row_places(name: str, writer: str, values: Sequence[str], partitions: Sequence[str]) -> Places:
    """Return the rows of files, of tasks, or of the recordings with these hashes, in partitions of the writer's crane."""
    column = {RECORDINGS: "path", RESULTS: "task"}.get(name, "recording")
    if not values:
        return Places("", None)
    crane = None if writer == NO_GATEWAY else writer.split("/")[1]
    partition = ALL_TABLES[name].partition
    expression = ds.field(column).isin(list(values))
    if crane is None:
        return Places(f"crane IS NULL AND {_in(column, values)}", ds.field("crane").is_null() & expression)
    return Places(
        f"crane = {_text(crane)} AND {_in(partition, partitions)} AND {_in(column, values)}",
        (ds.field("crane") == crane) & ds.field(partition).isin(list(partitions)) & expression,
    )


def _in(column: str, values: Iterable[str]) -> str:
    return f"{column} IN ({', '.join(map(_text, sorted(set(values))))})"


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"


def partition_name(name: str) -> str:
    """Return the column by which a table is divided, beside the crane."""
    return ALL_TABLES[name].partition


def partition_of(name: str, utc_ns: int) -> str:
    """Return the partition of a recording that begins at a time: its day or its month, UTC."""
    day = f"{pa.scalar(utc_ns // 1000, pa.timestamp('us', tz='UTC')).as_py():%Y-%m-%d}"
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
    constant[spec.partition] = None if file.gateway is None else partition_of(name, file.utc_ns)
    columns |= {key: [value] * count for key, value in constant.items()}
    return pa.table([_array(columns[field.name], field.type) for field in schema], schema=schema)


def _array(values: list[Any], kind: pa.DataType) -> pa.Array:
    if pa.types.is_timestamp(kind):
        values = [None if value is None else value // 1000 for value in values]
    return pa.array(values, kind)


def recordings_table(files: Sequence[IndexedFile]) -> pa.Table:
    """Return files as rows of the table of recordings."""
    tables = [table_of(RECORDINGS, [file.row], file, file.utc_ns - file.row.gateway_time_ns) for file in files]
    return pa.concat_tables(tables) if tables else schema_of(RECORDINGS).empty_table()


def _indexed(row: dict[str, Any]) -> IndexedFile:
    gateway = None if row["crane"] is None else (row["site"], row["crane"], row["sensor"])
    own = {field.name: row[field.name] for field in fields(RecordingRow)}
    own["end_utc"] = _ns(own["end_utc"])
    return IndexedFile(gateway, row["recording"], row["trust"], _ns(row["utc"]), RecordingRow(**own))


def _ns(time: datetime) -> int:
    return round(time.timestamp() * 1_000_000) * 1000


def _reason(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
