"""Recordings as tables: the calibrated samples, or the messages of a topic with one column for each of its numbers and texts.

The files, CSV, and Parquet with the extra `parquet`, appear completely or not at all.
"""

import csv
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np

from gateway.atomic_io import replace_file
from gateway.errors import InputError
from gateway.recording.format.content import schema_bytes
from gateway.recording.reading.interval import iso_utc_ns
from gateway.recording.reading.recording_file import Selection
from gateway.recording.reading.sample_calibration import CalibratedBlock, CalibratedReader
from gateway.recording.reading.timeline import ReportProgress, Timeline, ignore_progress
from gateway.topics import TOPICS

if TYPE_CHECKING:
    import pyarrow as pa


BATCH_ROWS = 4096
"""Rows of a batch. Basis: a choice; rows by the thousand cost one call, and a batch needs less than a megabyte."""
COMPONENTS = ("x", "y", "z")
ColumnType = Literal["number", "integer", "boolean", "string", "utc"]
Batch = list[Sequence[Any]]
"""The values of some rows, column by column; None: not known."""


@dataclass(frozen=True, slots=True)
class TableColumn:
    """A column of a table; `utc` is a time in ns since 1970."""

    name: str
    type: ColumnType


@dataclass(frozen=True, slots=True)
class RecordingTable:
    """A table that is read as it is written."""

    columns: tuple[TableColumn, ...]
    batches: Iterator[Batch]


TIME = TableColumn("time_s", "number")
UTC = TableColumn("utc", "utc")
AXIS_COLUMNS = tuple(TableColumn(name, "number") for name in ("ax_g", "ay_g", "az_g"))
TEMPERATURE = TableColumn("temperature_c", "number")


def samples_table(
    reader: CalibratedReader, origin_ns: int, *, with_utc: bool, report: ReportProgress = ignore_progress
) -> RecordingTable:
    """Return the specific force at full rate; `time_s` counts from `origin_ns` of gateway time.

    The temperature is a column where the first sample has one.
    """
    batches = _gather(reader.blocks(report))
    first = next(batches, None)
    has_temperature = first is not None and first[0].block.temperature_c is not None
    columns = [TIME, *([UTC] if with_utc else []), *AXIS_COLUMNS, *([TEMPERATURE] if has_temperature else [])]

    def rows() -> Iterator[Batch]:
        for blocks in () if first is None else chain([first], batches):
            time_ns = np.concatenate([each.block.time_ns for each in blocks])
            lengths = [len(each.block) for each in blocks]
            batch: Batch = [((time_ns - origin_ns) / 1e9).tolist()]
            if with_utc:
                batch.append((time_ns + np.repeat([each.wall_offset_ns for each in blocks], lengths)).tolist())
            batch += np.concatenate([each.force_g for each in blocks]).T.tolist()
            if has_temperature:
                batch.append([each.block.temperature_c for each in blocks for _ in range(len(each.block))])
            yield batch

    return RecordingTable(tuple(columns), rows())


def topic_table(
    timeline: Timeline, topic: str, selection: Selection, origin_ns: int, report: ReportProgress = ignore_progress
) -> RecordingTable:
    """Return the messages of a topic of the gateway; a field of a part of the message is named `part.field`.

    Lists of numbers of a fixed length have a column for each component; every other list or table is text in JSON.
    """
    fields = tuple(_fields(json.loads(schema_bytes(topic))))
    wanted = replace(selection, topics=frozenset({TOPICS[topic].path}))

    def rows() -> Iterator[Batch]:
        gathered: list[list[Any]] = []
        for message in timeline.messages(wanted, report):
            recorded = message.recorded
            try:
                content = json.loads(recorded.data)
            except ValueError:
                message.file.losses.unreadable_messages += 1
                continue
            time_s = (recorded.log_time_ns - origin_ns) / 1e9
            gathered.append([time_s, recorded.publish_time_ns, *(field.value(content) for field in fields)])
            if len(gathered) == BATCH_ROWS:
                yield [list(column) for column in zip(*gathered, strict=True)]
                gathered = []
        if gathered:
            yield [list(column) for column in zip(*gathered, strict=True)]

    return RecordingTable((TIME, UTC, *(TableColumn(field.name, field.type) for field in fields)), rows())


@dataclass(frozen=True, slots=True)
class _Field:
    """A value within the messages of a topic."""

    path: tuple[str, ...]
    type: ColumnType
    index: int | None = None
    """Place in a list of numbers."""

    @property
    def name(self) -> str:
        return ".".join(self.path) + ("" if self.index is None else f".{COMPONENTS[self.index]}")

    def value(self, content: Any) -> Any:
        """Return the value in a message; None where it is left out."""
        for name in self.path:
            content = content.get(name) if isinstance(content, dict) else None
        if content is not None and self.index is not None:
            return content[self.index] if isinstance(content, list) and len(content) > self.index else None
        if self.type == "string" and content is not None and not isinstance(content, str):
            return json.dumps(content, ensure_ascii=False)
        return content


def _fields(schema: dict[str, Any], path: tuple[str, ...] = ()) -> Iterator[_Field]:
    for name, entry in schema["properties"].items():
        place, kind, items = (*path, name), entry.get("type"), entry.get("items", {})
        length = entry.get("maxItems", 0)
        if kind == "object" and entry.get("properties"):
            yield from _fields(entry, place)
        elif (
            kind == "array" and items.get("type") == "number" and 0 < length == entry.get("minItems") <= len(COMPONENTS)
        ):
            yield from (_Field(place, "number", index) for index in range(length))
        else:
            yield _Field(place, kind if kind in ("number", "integer", "boolean") else "string")


def _gather(blocks: Iterable[CalibratedBlock]) -> Iterator[list[CalibratedBlock]]:
    """Yield blocks in lists of about `BATCH_ROWS` samples."""
    gathered: list[CalibratedBlock] = []
    count = 0
    for block in blocks:
        gathered.append(block)
        count += len(block.block)
        if count >= BATCH_ROWS:
            yield gathered
            gathered, count = [], 0
    if gathered:
        yield gathered


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
