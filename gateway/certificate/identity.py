"""Identity of a calibration: device, method, who, when, by which software, from which record."""

from gateway.calibration.record import CalibrationRecord
from gateway.documents.format import UNKNOWN, format_short
from gateway.documents.text import printable_text

MAX_FIELD_CHARACTERS = 40
"""Characters of a field. Basis: a choice; one line of its column."""


def identity_facts(record: CalibrationRecord) -> tuple[tuple[str, str], ...]:
    """Return names and values, two in a row; the template prints the hash apart."""
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
    return tuple((name, printable_text(value, MAX_FIELD_CHARACTERS)) for name, value in facts)


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
