"""The tables of an archive: one dataclass a table, whose fields are its columns.

A name that ends in `utc` is a time in ns since 1970, stored as a timestamp of microseconds; other units are suffixes.
Who acknowledged an alert stays in the signed recording; who calibrated is in the record of the calibration.
"""

from dataclasses import dataclass, fields
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_type_hints

import pyarrow as pa

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Row = TypeVar("Row", bound="DataclassInstance")

Trust = Literal["verified", "consistent", "unsigned", "refused"]
"""verified: signed with the gateway's key, known from elsewhere; consistent: with a key that stands in the recording alone;
unsigned: nothing or not everything in it is signed; refused: not taken into the tables."""
Status = Literal["counted", "copy", "superseded", "refused", "deleted"]
"""counted: its rows are in the tables; copy: the same bytes under another name; superseded: a better version of the segment is
counted; refused: see `reason`; deleted: its rows and its file were, see `reason`."""
TRUST_RANK: dict[Trust, int] = {"refused": 0, "unsigned": 1, "consistent": 2, "verified": 3}
"""Definition: the order of the answers."""

TaskState = Literal["done", "refused", "poison"]
"""done: the command has answered; refused: it said why it cannot answer; poison: it died or took too much in every attempt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingRow:
    """The largest estimate of a swing, one for each period."""

    gateway_time_ns: int
    phi_max_deg: float
    u_deg: float | None
    azimuth_deg: float | None
    lean_deg: float | None
    period_s: float | None
    calibration_id: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSecond:
    """The rope's motion in a second."""

    gateway_time_ns: int
    """Start of the second."""
    state: str
    """The last one."""
    value_count: int
    known_count: int
    """Those with an angle."""
    angle_deg: float | None
    """The last known one."""
    angle_min_deg: float | None
    angle_max_deg: float | None
    upper_max_deg: float | None
    """Largest upper end of the 95 % interval."""
    lean_deg: float | None
    length_m: float | None
    calibration_id: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionMinute:
    """The extremes of a minute, from which reports over months are made."""

    gateway_time_ns: int
    """Start of the minute."""
    seconds: int
    """Seconds with a message."""
    known_s: float
    """Time in which the angle is known."""
    angle_max_deg: float | None
    upper_max_deg: float | None
    largest_utc: int | None
    """Time of the largest angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertRow:
    """An alert from raised to cleared, as far as one recording has it; `incident` joins the parts of several."""

    gateway_time_ns: int
    incident: str | None
    rule: str
    level: str
    end_utc: int | None
    is_raised_before: bool
    ended: str
    largest_deg: float | None
    largest_upper_deg: float | None
    limit_deg: float | None
    is_corrected: bool
    is_acknowledged: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionRow:
    """A time in which condition and validity of the alerts stayed the same."""

    gateway_time_ns: int
    duration_s: float
    verdict: str
    cause: str | None
    trusted: bool
    validity: str | None
    """Whether the levels of the alerts are known, and why not."""
    reason: str | None
    """The first reason, numbers replaced by #."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthRow:
    """The last state of the gateway in a minute."""

    gateway_time_ns: int
    state: str
    device_id: str | None
    device_kind: str
    software: str
    uptime_s: float
    measured_rate_hz: float | None
    samples: int
    lost: int
    invalid: int
    faults: int
    """Faults since start, of all names."""
    standing_faults: str
    dropped: int
    recording_error: str | None
    disk_free_mb: float | None
    cpu_percent: float | None
    resident_mb: float | None
    battery_percent: float | None
    signal_dbm: float | None
    drift_state: str | None
    drift_norm_error_mg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationRow:
    """A calibration from its first message on."""

    gateway_time_ns: int
    status: str
    calibration_id: str | None
    device_id: str
    record: str
    """The record as JSON; empty: there is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockRow:
    """The quality of the clock from here on, or a step of the wall clock."""

    gateway_time_ns: int
    quality: str
    wall_offset_ns: int
    stepped: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingRow:
    """A file of the archive with what its verification found. The only table that knows files, and the one that decides."""

    path: str
    """Name within the source."""
    version: str
    """What the store says of this version of the file: it is read again where that changes."""
    gateway_time_ns: int = 0
    """First message."""
    end_utc: int = 0
    size_bytes: int
    status: Status
    reason: str
    """Why it is refused, superseded or not verified; remarks of the verification."""
    segment: int | None = None
    boot_id: str = ""
    software: str = ""
    public_key: str = ""
    """The key that has signed it; empty: none."""
    given_key: str = ""
    """The key that it was compared with; empty: none was known."""
    asked_ca: str | None = ""
    """SHA-256 of the site's CA, where it was asked for the key; None: of an older version."""
    statement_sha256: str = ""
    previous_sha256: str = ""
    is_final: bool = False
    is_trimmed: bool = False
    unreadable: int = 0
    """Messages and records that cannot be read."""
    nameless: str | None = ""
    """When, by whom and why the names of people were taken out of its rows; empty: they were not; None: of an older version."""


def row_of(kind: type[Row], source: object, /, **own: Any) -> Row:
    """Return a row that takes the columns that are not given from the fields of a source with the same names."""
    taken = (each.name for each in fields(kind) if each.name not in own)
    return kind(**own, **{name: getattr(source, name) for name in taken})


@dataclass(frozen=True, slots=True)
class IndexedFile:
    """A file with what all tables say of a recording."""

    gateway: tuple[str, str, str] | None
    recording: str
    """SHA-256 of the file."""
    trust: Trust
    utc_ns: int
    """Of the first message."""
    row: RecordingRow


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """What came of a task: a command of one machine over some recordings of a gateway."""

    gateway_time_ns: int
    """First message of the first recording."""
    kind: str
    task: str
    """Hash of kind, software, other calibration and recordings: the same task is done once."""
    software: str
    state: TaskState
    verdict: str
    reason: str
    content: str
    """The command's own JSON; empty where there is none."""
    recordings: int
    """Number of them."""
    subject: str
    """Hash of the recordings: the same for every version and calibration."""
    calibration: str | None
    """Record that took the place of the recorded ones in a replay; None: none did."""
    attempts: int
    duration_s: float


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the archive."""

    row: type[Any]
    partition: Literal["from_day", "from_month"] = "from_month"
    """Beside the crane: day or month in which the recording begins, UTC. A day of motion is some megabytes."""


TABLES: dict[str, Table] = {
    "swings": Table(SwingRow),
    "motion": Table(MotionSecond, "from_day"),
    "minutes": Table(MotionMinute),
    "alerts": Table(AlertRow),
    "conditions": Table(ConditionRow),
    "health": Table(HealthRow),
    "calibrations": Table(CalibrationRow),
    "clock": Table(ClockRow),
}
RECORDINGS, RESULTS = "recordings", "results"
"""The table of the files, which is written last and decides what counts; the one of the results of tasks."""
ALL_TABLES = {**TABLES, RECORDINGS: Table(RecordingRow), RESULTS: Table(ResultRow)}
NAMES = {"calibrations": "record", RESULTS: "content"}
"""Columns that may name people, by table. Definition: who calibrated is in the record, and answers may have texts of the
gateway."""
COMMON = {
    "site": pa.string(),
    "crane": pa.string(),
    "sensor": pa.string(),
    "recording": pa.string(),
    "trust": pa.string(),
    "utc": pa.timestamp("us", tz="UTC"),
}
"""Columns of every table: whose row it is, the SHA-256 of the file, whether it is verified, and when."""
_TYPES = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}


def schema_of(table: str) -> pa.Schema:
    """Return the columns of a table."""
    spec = ALL_TABLES[table]
    hints = get_type_hints(spec.row)
    own = {field.name: _column_type(field.name, hints[field.name]) for field in fields(spec.row)}
    return pa.schema({**COMMON, **own, spec.partition: pa.string()})


def _column_type(name: str, hint: Any) -> pa.DataType:
    if name.endswith("utc"):
        return pa.timestamp("us", tz="UTC")
    options = [each for each in get_args(hint) if each is not NoneType] if isinstance(hint, UnionType) else [hint]
    return _TYPES.get(options[0], pa.string())
