"""Rows of recordings as Arrow tables, with the columns that all tables share, and files as a table gives them back."""

from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime
from typing import Any

import pyarrow as pa

from gateway.archive.rows import ALL_TABLES, RECORDINGS, RecordingRow, schema_of
from gateway.archive.versions import IndexedFile


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
    own = {field.name: row[field.name] for field in fields(RecordingRow)}
    own["end_utc"] = _ns(own["end_utc"])
    return IndexedFile(gateway, row["recording"], row["trust"], _ns(row["utc"]), RecordingRow(**own))


def _ns(time: datetime) -> int:
    return round(time.timestamp() * 1_000_000) * 1000
