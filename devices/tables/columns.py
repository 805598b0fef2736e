"""Columns of a foreign table by the names in its header: axes, time, temperature, angular rates, and their units."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from devices.tables.layout import TableUnit

AXES = ("x", "y", "z")
ACCELERATION_WORDS = frozenset(
    [
        "acc",
        "accel",
        "accelerometer",
        "acceleration",
        "accelerazione",
        "aceleracion",
        "aceleración",
        "accélération",
        "beschleunigung",
        "versnelling",
        "przyspieszenie",
        "加速度",
        "a",
        "f",
        "force",
    ]
)
NEUTRAL_WORDS = frozenset(
    ["axis", "achse", "axe", "eje", "value", "data", "sensor", "imu", "u", "raw", "uncalibrated", "total", "with"]
)
"""Words of a triple that say nothing of its quantity."""
WITHOUT_GRAVITY_WORDS = frozenset(
    ["linear", "lin", "linacc", "user", "useracceleration", "linearacceleration", "motion"]
)
"""Words of columns from which an application has removed gravity: without it nothing states where down is."""
RECORD_GRAVITY = (
    "record the acceleration with gravity: in phyphox 'Acceleration (with g)', "
    "in Sensor Logger 'Accelerometer Uncalibrated'"
)
RATE_WORDS = frozenset(
    ["gyr", "gyro", "gyroscope", "gyroskop", "gyroscoop", "giroscopio", "w", "omega", "rotation", "angular", "g"]
)
OTHER_WORDS = (RATE_WORDS - {"g"}) | frozenset(
    ["mag", "magnet", "magnetometer", "b", "gravity", "schwere", "q", "quat", "euler", "angle"]
)
"""Words of triples that are no acceleration."""
TIME_WORDS = frozenset(
    [
        "time",
        "t",
        "timestamp",
        "elapsed",
        "seconds",
        "zeit",
        "temps",
        "tiempo",
        "tempo",
        "tijd",
        "tid",
        "czas",
        "时间",
        "時間",
        "date",
        "datetime",
        "clock",
    ]
)
COUNTER_WORDS = frozenset(
    ["sample", "samples", "index", "counter", "count", "n", "frame", "seq", "sequence", "number", "row"]
)
TEMPERATURE_WORDS = frozenset(["temperature", "temp", "temperatur", "température", "temperatura"])

UNITS: dict[str, TableUnit] = {
    "g": "g",
    "mg": "mg",
    "m/s^2": "m/s2",
    "m/s²": "m/s2",
    "m/s2": "m/s2",
    "m s2": "m/s2",
    "m/s/s": "m/s2",
    "ms2": "m/s2",
    "ms-2": "m/s2",
    "mps2": "m/s2",
    "v": "V",
    "volt": "V",
    "volts": "V",
    "counts": "counts",
    "raw": "counts",
    "lsb": "counts",
}
CLOCK_UNIT = "hms"
"""Unit of a time of day that is written as one number, 161732.99 for 16:17:32.99."""
TIME_UNITS_PER_S: dict[str, float] = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
"""Definition: units."""
RATE_UNITS_DPS: dict[str, float] = {
    "deg/s": 1.0,
    "°/s": 1.0,
    "dps": 1.0,
    "rad/s": 57.29577951308232,
    "rad s": 57.29577951308232,
    "deg s": 1.0,
}
"""Definition: units."""


@dataclass(frozen=True, slots=True)
class ColumnName:
    """A name in a header, in lower-case words, with the unit that it states."""

    text: str
    words: tuple[str, ...]
    unit: str
    """In lower case; empty where the name states none."""


@dataclass(frozen=True, slots=True)
class AxisColumns:
    """Three columns of one vector: their places, 0-based, and the unit in their names."""

    places: tuple[int, int, int]
    unit: str
    words: tuple[str, ...]
    """Words of the names without the axis."""


def parse_name(text: str) -> ColumnName:
    """Return the words and the unit of a name such as `Acceleration x (m/s^2)`, `accX [mg]`, `ax_g` or `time_ms`."""
    text = text.strip().strip('"').strip()
    bracket = re.search(r"[(\[]\s*([^)\]]*?)\s*[)\]]\s*$", text)
    unit, name = "", text
    if bracket is not None and bracket.group(1).lower() in (*UNITS, *TIME_UNITS_PER_S, *RATE_UNITS_DPS, "°c", "c"):
        unit, name = bracket.group(1).lower(), text[: bracket.start()]
    name = re.sub(r"(?<=[a-zà-ÿ0-9])(?=[A-Z])", " ", name)  # accX -> acc X
    words = [word for word in re.split(r"[\W_]+", name.lower()) if word]
    if not unit and len(words) > 1:
        words, unit = _unit_at_end(words)
    if words and words[-1][-1] in AXES and words[-1][:-1] in ACCELERATION_WORDS | RATE_WORDS | {"u", "m"}:
        words[-1:] = [words[-1][:-1], words[-1][-1]]  # ax -> a x
    return ColumnName(text, tuple(words), unit)


def _unit_at_end(words: list[str]) -> tuple[list[str], str]:
    joined = " ".join(words[-2:])
    if joined in (*UNITS, *RATE_UNITS_DPS):
        return words[:-2], joined
    known = words[-1] in (*UNITS, *TIME_UNITS_PER_S, *RATE_UNITS_DPS, "c")
    return (words[:-1], words[-1]) if known and words[-1] not in AXES else (words, "")


def find_triples(names: Sequence[str]) -> list[AxisColumns]:
    """Return the triples of columns whose names differ in nothing but the axis, in the order of the file."""
    groups: dict[tuple[tuple[str, ...], str], dict[str, int]] = {}
    for place, text in enumerate(names):
        name = parse_name(text)
        axes = [word for word in name.words if word in AXES]
        if len(axes) == 1:
            stem = tuple(word for word in name.words if word not in AXES)
            groups.setdefault((stem, name.unit), {}).setdefault(axes[0], place)
    return [
        AxisColumns((places["x"], places["y"], places["z"]), unit, stem)
        for (stem, unit), places in groups.items()
        if len(places) == 3
    ]


def is_acceleration(triple: AxisColumns) -> bool:
    """Return whether the names state an acceleration with gravity, or nothing."""
    if (OTHER_WORDS | WITHOUT_GRAVITY_WORDS).intersection(triple.words) or triple.unit in RATE_UNITS_DPS:
        return False
    stated = {word.rstrip("0123456789") for word in triple.words} - NEUTRAL_WORDS - {""}
    return not stated or bool(stated & ACCELERATION_WORDS) or triple.unit in UNITS


def is_without_gravity(triple: AxisColumns) -> bool:
    """Return whether the names state an acceleration from which gravity was removed."""
    return bool(WITHOUT_GRAVITY_WORDS.intersection(triple.words)) and RATE_WORDS.isdisjoint(triple.words)


def is_rate(triple: AxisColumns) -> bool:
    """Return whether the names state angular rates in a known unit."""
    return bool(RATE_WORDS.intersection(triple.words)) and triple.unit in RATE_UNITS_DPS


def find_time(names: Sequence[str]) -> int | None:
    """Return the place of the column of the time; of several that of the one whose name states seconds, or the first."""
    found = [(place, parse_name(text)) for place, text in enumerate(names)]
    times = [
        (place, name) for place, name in found if TIME_WORDS.intersection(name.words) or name.unit in TIME_UNITS_PER_S
    ]
    seconds = [place for place, name in times if name.unit in ("s", "sec") or set(name.words) & {"seconds", "elapsed"}]
    return next(iter([*seconds, *(place for place, _ in times)]), None)


def find_temperature(names: Sequence[str]) -> int | None:
    """Return the place of the column of the temperature in degrees Celsius."""
    found = ((place, parse_name(text)) for place, text in enumerate(names))
    return next(
        (place for place, name in found if TEMPERATURE_WORDS.intersection(name.words) and name.unit in ("", "c", "°c")),
        None,
    )


def is_counter(text: str) -> bool:
    """Return whether a name states a sample counter."""
    return bool(COUNTER_WORDS.intersection(parse_name(text).words))
