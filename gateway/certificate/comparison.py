"""What changed since the parent, and how long this record can be expected to hold."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.drift.change import DriftChange, change_between
from gateway.calibration.drift.records import MEASURING_METHODS
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.certificate.element import Content, element, short, table
from gateway.certificate.figures import UNKNOWN, fixed, with_u
from gateway.certificate.forecast import forecast, sentence

Array = NDArray[np.float64]
SIGNIFICANT = 2.0
"""A change beyond this many standard uncertainties is one."""
MOST = 260


def comparison(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord]
) -> Element:
    """Changes against the parent, and the drift over all records at hand."""
    if parent is None:
        said = (
            "This is the first record of the device: there is nothing to compare it with."
            if record.parent is None
            else "The parent record is not at hand: nothing is compared."
        )
        return element("section", element("h2", "Change since the parent"), element("p", said, class_="missing"))
    title = element("h2", "Change since the parent ", short(parent.id, 32), f" ({short(parent.created_utc, 25)})")
    try:
        change = change_between(parent, record)
    except CalibrationError as error:
        return element("section", title, element("p", short(f"Not compared: {error}", MOST), class_="missing"))
    measured = record.method in MEASURING_METHODS
    return element(
        "section", title, _changes(change, measured), _told(change, measured), _drift([*earlier, parent, record])
    )


def differs_from_named(record: CalibrationRecord, parent: CalibrationRecord | None) -> list[str]:
    """A warning where the record compared with is not the one that this one names."""
    if parent is None or parent.id == record.parent:
        return []
    return [f"compared with record {parent.id}, but the parent that this record names is {record.parent or 'none'}"]


def _changes(change: DriftChange, measured: bool) -> Element:
    """One row per axis; without uncertainties where the record carries its parent's values on."""
    turn_deg, u_turn_deg = _turn_deg(change)
    rows: list[list[Content]] = [
        [
            "xyz"[axis],
            _figure(1000 * change.offset_g[axis], 1000 * change.u_offset_g[axis], measured),
            _figure(1000 * change.scale[axis], 1000 * change.u_scale[axis], measured),
            fixed(float(change.tilt_error_deg[axis]), 3),
            _figure(turn_deg[axis], u_turn_deg[axis], measured),
            _verdict(change, axis) if measured else UNKNOWN,
        ]
        for axis in range(3)
    ]
    head = [
        "axis",
        "offset / mg",
        "scale / mg at 1 g",
        "tilt error by both / °",
        "turn about the axis / °",
        "beyond 2 u",
    ]
    return table(head, rows, "numbers")


def _figure(value: float, u_value: float, measured: bool) -> str:
    return with_u(float(value), float(u_value)) if measured else fixed(float(value), 3)


def _verdict(change: DriftChange, axis: int) -> str:
    pairs = [
        ("offset", change.offset_g[axis], change.u_offset_g[axis]),
        ("scale", change.scale[axis], change.u_scale[axis]),
    ]
    changed = [name for name, value, u_value in pairs if abs(value) > SIGNIFICANT * u_value]
    return " and ".join(changed) or "no"


def _turn_deg(change: DriftChange) -> tuple[Array, Array]:
    """Rotation of the axes between the records, from the antisymmetric part of the gain, and its uncertainty."""
    pick = np.zeros((3, 12))
    for axis, (row, column) in enumerate(((2, 1), (0, 2), (1, 0))):
        pick[axis, 3 * row + column], pick[axis, 3 * column + row] = 0.5, -0.5
    gain = np.concatenate([change.gain.ravel(), change.offset_g])
    u_turn = np.sqrt(np.clip(np.diag(pick @ change.covariance @ pick.T), 0, None))
    return np.degrees(pick @ gain), np.degrees(u_turn)


def _told(change: DriftChange, measured: bool) -> Element:
    worst_deg = float(change.tilt_error_deg.max())
    uncertainty = (
        "± is the expanded uncertainty of both records, taken as independent."
        if measured
        else "This record carries its parent's offset and scale on; it measured neither."
    )
    return element(
        "p",
        f"Read with the parent, this sensor would now be wrong by up to {fixed(worst_deg, 3)}° on its worst axis, turns left "
        f"aside. {uncertainty}",
    )


def _drift(records: list[CalibrationRecord]) -> Element:
    unique = list({record.id: record for record in records}.values())
    try:
        report = forecast(unique)
    except CalibrationError as error:
        return element("p", short(f"No forecast: {error}.", MOST), class_="drift missing")
    return element(
        "p", element("strong", sentence(report)), " ", short("; ".join(report.warnings), MOST), class_="drift"
    )
