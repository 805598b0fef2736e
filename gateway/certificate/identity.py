"""Identity of a calibration: device, method, who, when, by which software, from which record."""

from dataclasses import dataclass

from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import UNKNOWN, format_short
from gateway.documents.text import printable_text

FIELD = 40
HASH = 64
WARNING = 160
MOST_WARNINGS = 4


@dataclass(frozen=True, slots=True)
class WarningsView:
    """Warnings as they are printed."""

    count: int
    shown: tuple[str, ...]

    @property
    def hidden(self) -> int:
        """Number of warnings that do not fit."""
        return self.count - len(self.shown)


def identity_facts(record: CalibrationRecord) -> tuple[tuple[str, str], ...]:
    """Return names and values, two in a row; the hash is printed apart."""
    facts = (
        ("Device", record.device_id),
        ("Method", record.method),
        ("Made", record.created_utc),
        ("By", record.by),
        ("Record", record.id),
        ("Parent record", record.parent or "none"),
        ("Software", f"plumbline {record.software}"),
        ("Temperature", _temperature(record)),
        ("Reason", _reason(record)),
        ("Poses used", _poses(record)),
    )
    return tuple((name, printable_text(value, FIELD)) for name, value in facts)


def hash_text(record: CalibrationRecord) -> str:
    """Return the hash of the record's content."""
    return printable_text(record.sha256, HASH)


def warnings_view(record: CalibrationRecord, others: list[str]) -> WarningsView:
    """Return what a reader must know before any number: `others` that this page found, then the record's own."""
    texts = [*others, *record.warnings]
    return WarningsView(len(texts), tuple(printable_text(text, WARNING) for text in texts[:MOST_WARNINGS]))


def _poses(record: CalibrationRecord) -> str:
    used = sum(bool(pose.get("used", True)) for pose in record.poses)
    return f"{used} of {len(record.poses)}" if record.poses else "none in the record"


def _temperature(record: CalibrationRecord) -> str:
    known = record.temperature_c
    if not known:
        return "not recorded"
    mean, low, high = (format_short(known.get(name)) for name in ("mean", "min", "max"))
    return f"{mean} °C ({low} to {high} °C)"


def _reason(record: CalibrationRecord) -> str:
    reason = (record.model_extra or {}).get("reason")
    return reason if isinstance(reason, str) and reason else UNKNOWN
