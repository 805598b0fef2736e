"""Recordings of other programs as text: what their columns and numbers mean is stated, or found and said.

phyphox, Sensor Logger, WitMotion and most loggers write a header with names; laboratory sets often have columns of bare numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import SAME_AXES, AxesMap, map_axes
from devices.errors import RecordingError
from devices.recording import Recording
from devices.tables.columns import (
    CLOCK_UNIT,
    RATE_UNITS_DPS,
    RECORD_GRAVITY,
    TIME_UNITS_PER_S,
    UNITS,
    AxisColumns,
    find_temperature,
    find_time,
    find_triples,
    is_acceleration,
    is_counter,
    is_rate,
    is_without_gravity,
    parse_name,
)
from devices.tables.layout import (
    NATIVE,
    UNITS_PER_G,
    TableHead,
    TableLayout,
    TableUnit,
    is_number,
    read_head,
    seconds_of,
)
from devices.tables.native import read_table

MIN_RATE_HZ, MAX_RATE_HZ = 5.0, 5000.0
"""Sample rates of accelerometers. Basis: A table of time stamps has one unit among s, ms, µs and ns that gives such a rate."""


@dataclass(frozen=True, slots=True)
class UnitRange:
    """A unit, and the range of the median magnitude of readings in it."""

    unit: TableUnit
    low: float
    high: float


IN_MOTION = (UnitRange("g", 0.5, 2.0), UnitRange("m/s2", 5.0, 20.0), UnitRange("mg", 700.0, 1500.0))
"""Magnitudes of a sensor on a swinging load. Basis: half to twice 1 g, wider than a swing gives."""


@dataclass(frozen=True, slots=True)
class TableOptions:
    """What the user states of a table; None: it is found."""

    unit: TableUnit | None = None
    columns: tuple[str, ...] | None = None
    """Names, or 1-based numbers, of the columns of the axes; two: x and z of a swing in their plane, y is zero."""
    time: str | None = None
    """Name or number of the column of the time, with `:ms` behind it where it is not in seconds, `:hms` for HHMMSS."""
    rate_hz: float | None = None
    """Sample rate of rows without time, or counts per second of the column `time`."""
    units_per_g: float | None = None
    """Nominal sensitivity of counts or volts."""
    axes: AxesMap = SAME_AXES
    """Axes of the table that are x, y and z of the recording."""

    @property
    def is_planar(self) -> bool:
        """The table has the two axes in the plane of the swing alone."""
        return self.columns is not None and len(self.columns) == 2


NOTHING_STATED = TableOptions()


@dataclass(frozen=True, slots=True)
class ForeignRecording:
    """The readings of a table in their unit, and what was found of it."""

    recording: Recording
    """Readings in g where the unit is one of specific force, otherwise in `unit`."""
    unit: TableUnit
    findings: tuple[str, ...]
    """What was found of columns and units and not stated by the user, as sentences without the file."""


@dataclass(frozen=True, slots=True)
class _Axes:
    places: tuple[int, int, int]
    unit: TableUnit | None


@dataclass(frozen=True, slots=True)
class _Time:
    place: int | None
    per_s: float | None
    """Value of one second in the column, or the rate of rows without time; None: seconds."""
    is_text: bool
    finding: str


def is_native(path: Path) -> bool:
    """Return whether a table has the project's own columns, or none that could be read."""
    head = read_head(path)
    return not head.rows or any({NATIVE.time, *NATIVE.axes} <= set(header) for header in head.headers)


def read_foreign_table(path: Path, options: TableOptions, ranges: Sequence[UnitRange] = IN_MOTION) -> ForeignRecording:
    """Read a table of another program. `ranges` are the magnitudes by which a unit that nobody states is found.

    Raises `RecordingError` with the file and the option that would help.
    """
    head = read_head(path)
    if not head.rows:
        read_table(path)  # which states what is wrong with the file
        raise RecordingError(f"{path}: no line with three numbers; export the recording as CSV")
    names = _names(head)
    axes = _find_axes(path, head, names, options)
    time = _find_time(path, head, names, options, axes)
    gyro = next((triple for triple in find_triples(names) if is_rate(triple)), None)
    temperature = find_temperature(names)
    stated = options.unit or axes.unit
    layout = TableLayout(
        axes=_numbers(axes.places),
        unit="counts"
        if stated == "counts"
        else "g",  # the numbers as they are: their unit is found below, from all of them
        time=None if time.place is None else time.place + 1,
        rate_hz=time.per_s,
        temperature_c=None if temperature is None else temperature + 1,
        gyro_dps=None if gyro is None else _numbers(gyro.places),
        gyro_scale=1.0 if gyro is None else RATE_UNITS_DPS[gyro.unit],
        delimiter=head.delimiter,
        decimal=head.decimal,
        time_is_text=time.is_text,
    )
    try:
        recording = read_table(path, layout)
    except RecordingError as error:
        if options.unit != "counts" or axes.unit in (None, "counts"):
            raise
        raise RecordingError(
            f"{path}: --unit counts contradicts its columns, in {axes.unit}; leave --unit out"
        ) from error
    recording = replace(recording, raw=recording.raw * (1.0, float(not options.is_planar), 1.0))
    unit = stated or find_unit(path, recording.raw, ranges)
    findings = _findings(names, axes, options, time, unit, recording.raw)
    return ForeignRecording(_in_unit_and_axes(recording, unit, options.axes), unit, findings)


def _in_unit_and_axes(recording: Recording, unit: TableUnit, axes: AxesMap) -> Recording:
    """Return readings of specific force in g, and all of them in the axes of the result."""
    if unit == "counts":
        recording = replace(recording, unit="counts")
    recording = replace(recording, raw=recording.raw / UNITS_PER_G.get(unit, 1.0))
    if axes == SAME_AXES:
        return recording
    gyro_dps = None if recording.gyro_dps is None else map_axes(recording.gyro_dps, axes)
    return replace(recording, raw=map_axes(recording.raw, axes), gyro_dps=gyro_dps)


def find_unit(path: Path, raw: NDArray[np.float64], ranges: Sequence[UnitRange]) -> TableUnit:
    """Return the unit that the median magnitude of the readings shows. Raises `RecordingError` where it shows none."""
    norm = float(np.median(np.linalg.norm(raw, axis=1)))
    is_whole = bool(np.all(raw == np.rint(raw)))
    for candidate in ranges:
        if candidate.low < norm < candidate.high and (is_whole or candidate.unit != "counts"):
            return candidate.unit
    units = ", ".join(dict.fromkeys(each.unit for each in (*ranges, UnitRange("counts", 0, 0))))
    raise RecordingError(f"{path}: in which unit are its readings (|m| about {norm:.3g})? give --unit: {units}")


def _numbers(places: tuple[int, int, int]) -> tuple[int, int, int]:
    x, y, z = places
    return x + 1, y + 1, z + 1


def _names(head: TableHead) -> Sequence[str]:
    """Return the header in which the axes are found, or else the nearest one above the rows; without one, no names."""
    for header in head.headers:
        if find_triples(header):
            return header
    return head.headers[0] if head.headers else ()


def _find_axes(path: Path, head: TableHead, names: Sequence[str], options: TableOptions) -> _Axes:
    if options.columns is not None:
        places = [_place(path, head, names, column, "--columns") for column in options.columns]
        x, y, z = (places[0], *places) if options.is_planar else places
        unit = UNITS.get(parse_name(names[x]).unit) if names else None
        return _Axes((x, y, z), unit)
    triples = find_triples(names)
    found = [triple for triple in triples if is_acceleration(triple)]
    if len(found) > 1:
        shown = "; ".join(", ".join(names[place] for place in triple.places) for triple in found)
        raise RecordingError(f"{path}: has several triples of axes ({shown}); name one with --columns X,Y,Z")
    if found:
        return _Axes(found[0].places, _stated_unit(head, names, found[0]))
    if removed := next((triple for triple in triples if is_without_gravity(triple)), None):
        shown = ", ".join(names[place] for place in removed.places)
        raise RecordingError(f"{path}: gravity was removed from its columns {shown}; {RECORD_GRAVITY}")
    if not names and head.width in (3, 4, 5) and (head.width > 3 or options.time is None):
        first = 0 if head.width == 3 else 1
        return _Axes((first, first + 1, first + 2), None)
    shown = ", ".join(names or head.rows[0])[:160]
    raise RecordingError(f"{path}: which columns are the axes? give --columns X,Y,Z, names or numbers; it has: {shown}")


def _stated_unit(head: TableHead, names: Sequence[str], triple: AxisColumns) -> TableUnit | None:
    """Return the unit in the names of the axes, or in a line of units below or above them."""
    if triple.unit in UNITS:
        return UNITS[triple.unit]
    below = (header[triple.places[0]].strip("()[] ").lower() for header in head.headers if header is not names)
    return next((UNITS[entry] for entry in below if entry in UNITS), None)


def _place(path: Path, head: TableHead, names: Sequence[str], column: str, option: str) -> int:
    """Return the place of a column that is given by its name or number."""
    if column in names:
        return list(names).index(column)
    if column.isdigit() and 1 <= int(column) <= head.width:
        return int(column) - 1
    by_lower = [name.lower() for name in names]
    if column.lower() in by_lower:
        return by_lower.index(column.lower())
    shown = ", ".join(names) if names else f"no header, and {head.width} columns"
    raise RecordingError(f"{path}: {option}: there is no column {column}; it has {shown}")


def _find_time(path: Path, head: TableHead, names: Sequence[str], options: TableOptions, axes: _Axes) -> _Time:
    if options.time is not None:
        column, _, unit = options.time.partition(":") if options.time not in names else (options.time, "", "")
        place = _place(path, head, names, column, "--time")
        if unit and unit not in (*TIME_UNITS_PER_S, CLOCK_UNIT):
            raise RecordingError(
                f"{path}: --time: {unit} is no unit of time; {', '.join((*TIME_UNITS_PER_S, CLOCK_UNIT))} are"
            )
        if unit == CLOCK_UNIT:
            return _Time(place, None, is_text=True, finding="")
        if options.rate_hz is not None:
            return _Time(place, options.rate_hz, is_text=False, finding="")
        return _time(path, head, names, place, TIME_UNITS_PER_S.get(unit))
    if options.rate_hz is not None:
        return _Time(None, options.rate_hz, is_text=False, finding="")
    place_found = find_time(names) if names else (0 if head.width > 3 and _increases(head, 0) else None)
    if place_found is None and 0 not in axes.places and _increases(head, 0) and not (names and is_counter(names[0])):
        place_found = 0
    if place_found is None:
        raise RecordingError(f"{path}: no time column; give --rate HZ, or --time COLUMN")
    return _time(path, head, names, place_found, None)


def _time(path: Path, head: TableHead, names: Sequence[str], place: int, per_s: float | None) -> _Time:
    """Return the time in a column, in a stated unit, in that of its name, or in the one that gives a plausible rate."""
    name = names[place] if names else f"column {place + 1}"
    if not is_number(head.rows[0][place]):
        try:
            seconds_of(head.rows[0][place])
        except ValueError as error:
            raise RecordingError(f"{path}: {name}: {head.rows[0][place]!r} is no time; give --time COLUMN") from error
        return _Time(place, None, is_text=True, finding=f"{name}: dates or times of day")
    if per_s is None and names:
        per_s = TIME_UNITS_PER_S.get(parse_name(name).unit)
    if per_s is not None:
        return _Time(place, per_s, is_text=False, finding="")
    stamps = [float(row[place]) for row in head.rows if is_number(row[place])]
    interval = abs(stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)
    units = [unit for unit in ("s", "ms", "us", "ns") if _is_rate(TIME_UNITS_PER_S[unit], interval)]
    if not units or (names and is_counter(name)):
        raise RecordingError(
            f"{path}: {name}: its numbers are {interval:.3g} apart; say what one second is, with --time {name}:ms (s, us, ns), "
            "or --rate HZ beside --time for a sample counter"
        )
    return _Time(place, TIME_UNITS_PER_S[units[0]], is_text=False, finding=f"{name}: time in {units[0]}")


def _is_rate(per_s: float, interval: float) -> bool:
    return interval > 0 and MIN_RATE_HZ <= per_s / interval <= MAX_RATE_HZ


def _increases(head: TableHead, place: int) -> bool:
    stamps = [float(row[place]) for row in head.rows if is_number(row[place])]
    return len(stamps) > 1 and bool(np.all(np.diff(stamps) >= 0)) and stamps[-1] > stamps[0]


def _findings(
    names: Sequence[str],
    axes: _Axes,
    options: TableOptions,
    time: _Time,
    unit: TableUnit,
    raw: NDArray[np.float64],
) -> tuple[str, ...]:
    found = []
    if options.columns is None:
        shown = ", ".join(names[place] if names else str(place + 1) for place in axes.places)
        found.append(f"axes x, y, z: columns {shown}")
    if options.unit is None and axes.unit is None:
        norm = float(np.median(np.linalg.norm(raw, axis=1)))
        found.append(f"unit {unit}, by the median magnitude {norm:.4g}")
    if time.finding:
        found.append(time.finding)
    return tuple(found)
