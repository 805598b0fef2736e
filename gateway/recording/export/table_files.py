"""Tables as files that appear completely or not at all: CSV, and Parquet with the extra `parquet`."""

import csv
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from gateway.atomic_io import replace_file
from gateway.errors import InputError
from gateway.recording.export.tables import RecordingTable, TableColumn
from gateway.recording.reading.interval import iso_utc_ns

if TYPE_CHECKING:
    import pyarrow as pa


@contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """Yield a new file that takes the place of `path` at the end of the block; after an error nothing is left of it.

    Raises `InputError` where it cannot be written.
    """
    try:
        with replace_file(path) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another place") from error


def write_csv(path: Path, table: RecordingTable) -> int:
    """Write a table as CSV; return its number of rows. What is not known is empty. Raises `InputError`."""
    count = 0
    formats = [_csv_format(column) for column in table.columns]
    with new_file(path) as file:
        file.write(_csv_text([[column.name for column in table.columns]]))
        for batch in table.batches:
            texts = [list(map(text, values)) for text, values in zip(formats, batch, strict=True)]
            file.write(_csv_text(zip(*texts, strict=True)))
            count += len(batch[0])
    return count


def _csv_text(rows: Iterable[Sequence[str]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _csv_format(column: TableColumn) -> Callable[[Any], str]:
    """Return the function that turns a value into text: times to the nanosecond, numbers to nine digits."""
    if column.name == "time_s":
        return lambda value: f"{value:.9f}"
    if column.type == "number":
        return lambda value: "" if value is None else f"{value:.9g}"
    if column.type == "utc":
        return iso_utc_ns
    if column.type == "boolean":
        return lambda value: "" if value is None else str(value).lower()
    return lambda value: "" if value is None else str(value)


def write_parquet(path: Path, table: RecordingTable, description: Mapping[str, str]) -> int:
    """Write a table as Parquet, with a description of the recording; return its number of rows. Raises `InputError`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    count = 0
    fields = [pa.field(column.name, _parquet_type(column)) for column in table.columns]
    schema = pa.schema(fields, metadata=dict(description))
    with new_file(path) as file, pq.ParquetWriter(file, schema, compression="zstd") as writer:
        for batch in table.batches:
            arrays = [pa.array(values, field.type) for values, field in zip(batch, fields, strict=True)]
            writer.write_batch(pa.record_batch(arrays, schema=schema))
            count += len(batch[0])
    return count


def _parquet_type(column: TableColumn) -> "pa.DataType":
    import pyarrow as pa

    types = {"number": pa.float64(), "integer": pa.int64(), "boolean": pa.bool_(), "string": pa.string()}
    return pa.timestamp("ns", tz="UTC") if column.type == "utc" else types[column.type]
