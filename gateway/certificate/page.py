"""The certificate of a calibration record: one self-contained HTML page, one sheet of A4 when printed.

Fields of a record are text of unknown origin: the templates escape them, their length is bounded, and the page forbids itself
scripts and the network.
"""

import math
from collections.abc import Sequence

import numpy as np

from gateway.calibration.record import BudgetEntry, CalibrationRecord
from gateway.certificate.comparison import changes_since, differs_from_named
from gateway.certificate.plots import method_plot, pose_residuals
from gateway.certificate.traceability import UNCERTAINTY, decision_rule, reference, temperatures
from gateway.documents.environment import render
from gateway.documents.format import (
    UNKNOWN,
    format_fixed,
    format_short,
    format_with_uncertainty,
    power_of_ten,
    printable_text,
)
from gateway.numerics.array import Array

MAX_FIELD_CHARACTERS = 40
"""Characters of a field. Basis: a choice; one line of its column."""
MAX_EXPONENT = 300
"""Basis: a larger power of ten is no float of 64 bits."""
MAX_BUDGET_ROWS = 7
"""Basis: a choice; the table stays on one page."""
NEGLIGIBLE_CONTRIBUTION = 1e-6
"""mg or degrees: digits below say nothing. Basis: a choice; no sensor is good to a millionth."""
LIMITS_OF_ALL = (
    "It holds for this device only, at rest and within 1 g. It does not cover bandwidth, vibration, shock or larger forces.",
    "The hash shows that the record is unchanged. It is no signature and does not prove who made the record.",
)
LIMITS_BY_METHOD = {
    "six-position": "Inconsistent faces would show in the residuals; the matrix absorbs a tilt of the whole table, unseen.",
    "norm-fit": "The fit determines the axes relative to each other, not relative to the housing: zeroing in place does that.",
    "rotation": "The rig's angle is taken as true: a periodic error of the rig appears as an error of the sensor.",
    "thermal": "The ramps measure the sensor in its housing; a mount or a rope that bends with temperature is not in the model.",
    "thermal-rest": "Only the axis along the rope was measured over temperature, offset and scale as a sum.",
    "installed": "Swings and rests on the rope: sums that they cannot tell apart, and what is not listed, are the parent's.",
    "single-parameter": "Only relative angles within 5° of the level were calibrated; absolute tilt and magnitude were not.",
    "zero": "Zeroing removes offset and mount angle together, along the rope; scale and other attitudes are the parent's.",
}
NO_TEMPERATURE = "The temperature was not recorded, so it is not known how far the values hold in cold or heat."


def render_certificate(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> str:
    """Return the page. `earlier` are older records of the device, for a forecast from more than two.

    Never raises for a record.
    """
    with np.errstate(all="ignore"):  # numbers of unknown origin may overflow: what is not finite is shown as a dash
        return _render(record, parent, earlier)


def _render(record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord]) -> str:
    warnings = differs_from_named(record, parent)
    if sensitivities(record) is None:
        warnings.append("the correction matrix is singular: this record must not be used")
    return render(
        "certificate.html.j2",
        title=printable_text(f"Calibration certificate {record.id}", 90),
        record=record,
        parent=parent,
        facts=identity_facts(record),
        warnings=[*warnings, *record.warnings],
        correction_rows=correction_rows(record),
        matrix_unit=matrix_unit(record),
        contributions=largest_contributions(record),
        combined_u=combined_uncertainty(record),
        format_contribution=format_contribution,
        residual=pose_residuals(record),
        method_plot=method_plot(record),
        changes=None if parent is None else changes_since(record, parent, earlier),
        limits=limits(record),
    )


def identity_facts(record: CalibrationRecord) -> tuple[tuple[str, str], ...]:
    """Return device, method, who, when, software and parent as names and values, two in a row.

    The template prints the hash apart.
    """
    facts = (
        ("Device", record.device_id),
        ("Method", record.method),
        ("Made", record.created_utc),
        ("By", record.by),
        ("Record", record.id),
        ("Parent record", record.parent or "none"),
        ("Software", f"plumbline {record.software}"),
        ("Temperature", temperatures(record)),
        ("Reason", _reason(record)),
        ("Poses used", _poses(record)),
    )
    return tuple((name, printable_text(value, MAX_FIELD_CHARACTERS)) for name, value in facts)


def _poses(record: CalibrationRecord) -> str:
    used = sum(bool(pose.get("used", True)) for pose in record.poses)
    return f"{used} of {len(record.poses)}" if record.poses else "none in the record"


def _reason(record: CalibrationRecord) -> str:
    reason = (record.model_extra or {}).get("reason")
    return reason if isinstance(reason, str) and reason else UNKNOWN


def correction_rows(record: CalibrationRecord) -> tuple[tuple[str, ...], ...]:
    """Return for each axis its name, offset, sensitivity, three entries of the matrix, misalignment; values with U = 2 u."""
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    return tuple(_row(record, matrix, axis, _exponent(matrix)) for axis in range(3))


def matrix_unit(record: CalibrationRecord) -> str:
    """Return the unit in which the entries of the matrix are printed."""
    exponent = _exponent(np.array(record.correction_matrix, dtype=np.float64))
    return f"{power_of_ten(exponent)} g/{record.unit}" if exponent else f"g/{record.unit}"


def sensitivities(record: CalibrationRecord) -> Array | None:
    """Return the raw units per g of the axes, shape (3,); None where the matrix cannot be inverted."""
    try:
        return np.asarray(np.diag(np.linalg.inv(np.array(record.correction_matrix, dtype=np.float64))))
    except np.linalg.LinAlgError:
        return None


def _row(record: CalibrationRecord, matrix: Array, axis: int, exponent: int) -> tuple[str, ...]:
    u_parameter = np.sqrt(np.clip(np.diag(np.array(record.covariance, dtype=np.float64)), 0, None))
    factor = 10.0**-exponent
    entries = [
        format_with_uncertainty(factor * float(matrix[axis, column]), factor * float(u_parameter[3 * axis + column]))
        for column in range(3)
    ]
    sensitivity = sensitivities(record)
    shown = UNKNOWN
    if sensitivity is not None and matrix[axis, axis] != 0:
        u_relative = float(u_parameter[4 * axis]) / abs(float(matrix[axis, axis]))
        shown = format_with_uncertainty(float(sensitivity[axis]), abs(float(sensitivity[axis])) * u_relative)
    offset = format_with_uncertainty(float(record.offset[axis]), float(u_parameter[9 + axis]))
    return "xyz"[axis], offset, shown, *entries, _misalignment(record, "xyz"[axis])


def _misalignment(record: CalibrationRecord, axis: str) -> str:
    angles = (record.misalignment_deg or {}).get(axis)
    return printable_text("; ".join(format_fixed(angle, 3) for angle in angles[:2]), 40) if angles else UNKNOWN


def _exponent(matrix: Array) -> int:
    """Return the power of ten to factor out, so that the largest entry has a digit before the point."""
    largest = float(np.max(np.abs(matrix)))
    if largest <= 0 or 0.1 <= largest < 1000:
        return 0
    return int(np.clip(np.floor(np.log10(largest)), -MAX_EXPONENT, MAX_EXPONENT))


def largest_contributions(record: CalibrationRecord) -> list[BudgetEntry]:
    """Return the contributions to the uncertainty (GUM 5 and 8) in the order of the record.

    Where there are more than fit, the largest come first.
    """
    if len(record.budget) <= MAX_BUDGET_ROWS:
        return record.budget
    return sorted(record.budget, key=lambda entry: entry.u_g, reverse=True)[:MAX_BUDGET_ROWS]


def combined_uncertainty(record: CalibrationRecord) -> tuple[float, float]:
    """Return the root of the sum of squares of all contributions, in g and degrees."""
    return math.hypot(*(entry.u_g for entry in record.budget)), math.hypot(*(entry.u_deg for entry in record.budget))


def format_contribution(value: float) -> str:
    """Return an uncertainty in mg or degrees."""
    return f"< {NEGLIGIBLE_CONTRIBUTION:g}" if 0 < value < NEGLIGIBLE_CONTRIBUTION else format_short(value)


def limits(record: CalibrationRecord) -> tuple[str, ...]:
    """Return what the certificate of a record must not be taken to say."""
    known = record.temperature_c
    sentences = [
        f"Reference: {reference(record.method)}. {UNCERTAINTY}. {decision_rule(record)}.",
        *LIMITS_OF_ALL,
    ]
    if record.method in LIMITS_BY_METHOD:
        sentences.append(LIMITS_BY_METHOD[record.method])
    if known and record.thermal is None:
        low, high = format_short(known.get("min")), format_short(known.get("max"))
        sentences.append(
            f"Outside {low} to {high} °C the values were not measured, and no thermal model corrects them."
        )
    elif not known:
        sentences.append(NO_TEMPERATURE)
    return tuple(sentences)
