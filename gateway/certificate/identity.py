"""Whose certificate it is: device, method, who, when, by which software, from which record."""

from xml.etree.ElementTree import Element

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.element import element, short
from gateway.certificate.figures import UNKNOWN, significant

FIELD = 40
HASH = 64
WARNING = 160
MOST_WARNINGS = 4


def identity(record: CalibrationRecord) -> Element:
    """The facts, two in a row."""
    facts = [
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
    ]
    listed = element("dl", class_="facts")
    for name, value in facts:
        listed.append(element("div", element("dt", name), element("dd", short(value, FIELD))))
    listed.append(element("div", element("dt", "SHA-256"), element("dd", short(record.sha256, HASH)), class_="hash"))
    return listed


def warnings(record: CalibrationRecord, others: list[str]) -> Element:
    """What a reader must know before any number; the record's own and `others` that this page found."""
    said = [*others, *record.warnings]
    if not said:
        return element("p", "The procedure gave no warning.", class_="calm")
    shown = [element("li", short(text, WARNING)) for text in said[:MOST_WARNINGS]]
    if len(said) > MOST_WARNINGS:
        shown.append(element("li", f"and {len(said) - MOST_WARNINGS} more warnings: read them in the record"))
    count = "1 warning" if len(said) == 1 else f"{len(said)} warnings"
    return element("section", element("h2", f"⚠ {count}"), element("ul", *shown), class_="warnings", role="alert")


def _poses(record: CalibrationRecord) -> str:
    used = sum(bool(pose.get("used", True)) for pose in record.poses)
    return f"{used} of {len(record.poses)}" if record.poses else "the record keeps none"


def _temperature(record: CalibrationRecord) -> str:
    known = record.temperature_c
    if not known:
        return "not recorded"
    mean, low, high = (significant(known.get(name)) for name in ("mean", "min", "max"))
    return f"{mean} °C ({low} to {high} °C)"


def _reason(record: CalibrationRecord) -> str:
    reason = (record.model_extra or {}).get("reason")
    return reason if isinstance(reason, str) and reason else UNKNOWN
