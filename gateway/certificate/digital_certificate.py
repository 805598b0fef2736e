"""The digital calibration certificate of a record: XML by PTB's DCC schema 3.2.0 with quantities in D-SI 2.1.0.

Values are in SI: 1 g is 9.80665 m/s². A record knows neither country nor laboratory nor customer: the elements that the schema
requires for them say so, the country with a code that ISO 3166-1 leaves to its users.
"""

import re
from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

import numpy as np

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway.calibration.record import CalibrationError, CalibrationRecord, created_at
from gateway.certificate.page import limits, sensitivities
from gateway.certificate.traceability import UNCERTAINTY, decision_rule, reference
from gateway.numerics.array import Array

DCC, SI, XSI = "https://ptb.de/dcc", "https://ptb.de/si", "http://www.w3.org/2001/XMLSchema-instance"
SCHEMA_VERSION = "3.2.0"
UNKNOWN_COUNTRY = "ZZ"
NOT_STATED = "not stated"
M_S2 = r"\metre\second\tothe{-2}"
PER_M_S2 = r"\metre\tothe{-1}\second\tothe{2}"
RAW_UNITS = {"g": M_S2, "V": r"\volt", "counts": r"\one"}
SENSITIVITY_UNITS = {"g": r"\one", "V": rf"\volt{PER_M_S2}", "counts": PER_M_S2}
GAIN_UNITS = {"g": r"\one", "V": rf"{M_S2}\volt\tothe{{-1}}", "counts": M_S2}
NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no document of XML 1.0 may have. Definition: XML 1.0, section 2.2."""
METHOD_SOURCES = {
    "six-position": "Łuczak et al. 2022, eq. 7 to 18",
    "norm-fit": "magnitude of gravity in many poses",
    "rotation": "Łuczak n.d., eq. 11 and 12",
    "single-parameter": "Zhu et al. 2020, eq. 9 to 13, 19 to 21",
    "thermal": "Sawicki and Walendziuk 2016",
    "installed": "free swings and rests on the rope",
    "thermal-rest": "magnitude at rest against temperature",
    "zero": "reading at rest against the vertical",
}
register_namespace("dcc", DCC)
register_namespace("si", SI)
register_namespace("xsi", XSI)


def render_digital_certificate(record: CalibrationRecord) -> str:
    """Return the document. Raises `CalibrationError` for a record without a date, or whose matrix is singular."""
    raw_per_g = sensitivities(record)
    if raw_per_g is None or not np.all(np.isfinite(raw_per_g)):
        raise CalibrationError(f"record {record.id}: the correction matrix is singular; calibrate again")
    root = Element(
        f"{{{DCC}}}digitalCalibrationCertificate",
        {"schemaVersion": SCHEMA_VERSION, f"{{{XSI}}}schemaLocation": f"{DCC} {DCC}/v{SCHEMA_VERSION}/dcc.xsd"},
    )
    _add_administrative_data(_add(root, "administrativeData"), record)
    result = _add(_add(root, "measurementResults"), "measurementResult")
    _add_text(result, "name", f"Calibration of an accelerometer by {record.method}")
    method = _add(_add(result, "usedMethods"), "usedMethod")
    _add_text(method, "name", record.method)
    _add_text(method, "description", UNCERTAINTY)
    _add(method, "reference", METHOD_SOURCES.get(record.method, NOT_STATED))
    _add_software(_add(result, "usedSoftware"), record)
    equipment = _add(_add(result, "measuringEquipments"), "measuringEquipment")
    _add_text(equipment, "name", f"reference: {reference(record.method)}")
    if record.temperature_c:
        _add_temperature(_add(result, "influenceConditions"), record.temperature_c)
    _add_results(_add(result, "results"), record, raw_per_g)
    indent(root, space="")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _add_administrative_data(data: Element, record: CalibrationRecord) -> None:
    _add_software(_add(data, "dccSoftware"), record)
    core, day = _add(data, "coreData"), created_at(record).date().isoformat()
    _add(core, "countryCodeISO3166_1", UNKNOWN_COUNTRY)
    for name in ("usedLangCodeISO639_1", "mandatoryLangCodeISO639_1"):
        _add(core, name, "en")
    _add(core, "uniqueIdentifier", f"{record.id} sha256:{record.sha256}")
    for name in ("beginPerformanceDate", "endPerformanceDate"):
        _add(core, name, day)
    _add(core, "performanceLocation", "other")
    item = _add(_add(data, "items"), "item")
    _add_text(item, "name", "accelerometer")
    _add_text(_add(item, "manufacturer"), "name", NOT_STATED)
    identification = _add(_add(item, "identifications"), "identification")
    _add(identification, "issuer", "other")
    _add(identification, "value", record.device_id)
    _add_contact(_add(_add(data, "calibrationLaboratory"), "contact"), "in-house calibration, not accredited")
    person = _add(_add(data, "respPersons"), "respPerson")
    _add_text(_add(person, "person"), "name", record.by)
    _add(person, "role", "operator")
    _add_contact(_add(data, "customer"), NOT_STATED)
    statements = _add(data, "statements")
    rule = _add(statements, "statement")
    _add_text(rule, "name", "decision rule")
    _add(rule, "norm", "ISO/IEC 17025:2017, 7.8.6")
    _add_text(rule, "declaration", decision_rule(record))
    for name, sentences in (("limit of this certificate", limits(record)), ("warning", record.warnings)):
        for sentence in sentences:
            statement = _add(statements, "statement")
            _add_text(statement, "name", name)
            _add_text(statement, "declaration", sentence)


def _add_results(results: Element, record: CalibrationRecord, raw_per_g: Array) -> None:
    """Add offset, sensitivity, matrix, residual and budget."""
    u_parameter = np.sqrt(np.clip(np.diag(np.array(record.covariance, dtype=np.float64)), 0, None))
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    raw_unit_si = STANDARD_GRAVITY_M_S2 if record.unit == "g" else 1.0
    gravity = STANDARD_GRAVITY_M_S2 / raw_unit_si
    u_sensitivity = np.abs(raw_per_g) * u_parameter[[0, 4, 8]] / np.abs(np.diag(matrix))
    labels = [f"{row}{column}" for row in "xyz" for column in "xyz"]
    for name, named, values, u_values, unit in (
        (
            "zero-g offset",
            "xyz",
            np.array(record.offset) * raw_unit_si,
            u_parameter[9:] * raw_unit_si,
            RAW_UNITS[record.unit],
        ),
        ("sensitivity", "xyz", raw_per_g / gravity, u_sensitivity / gravity, SENSITIVITY_UNITS[record.unit]),
        ("correction matrix", labels, matrix.ravel() * gravity, u_parameter[:9] * gravity, GAIN_UNITS[record.unit]),
    ):
        _add_list(results, name, named, values.tolist(), u_values.tolist(), unit)
    _add_list(
        results, "prediction interval of a corrected reading", ["dm"],
        [float(record.prediction_interval_g) * STANDARD_GRAVITY_M_S2], None, M_S2,
    )  # fmt: skip
    if record.budget:
        _add_list(
            results, "standard uncertainty of a corrected reading, by cause",
            [f"{entry.source} (type {entry.type})" for entry in record.budget],
            [float(entry.u_g) * STANDARD_GRAVITY_M_S2 for entry in record.budget], None, M_S2,
        )  # fmt: skip


def _add_list(
    results: Element,
    name: str,
    labels: Iterable[str],
    values: Sequence[float],
    u_values: Sequence[float] | None,
    unit: str,
) -> None:
    """Add a result of several quantities, with U for k = 2 where standard uncertainties are given."""
    result = _add(results, "result")
    _add_text(result, "name", name)
    members = _add(_add(result, "data"), "list")
    for place, (label, value) in enumerate(zip(labels, values, strict=True)):
        real = _add_quantity(members, label, value, unit)
        if u_values is not None:
            expanded = _add(real, "expandedUnc", namespace=SI)
            _add(expanded, "uncertainty", _number(2 * u_values[place]), namespace=SI)
            _add(expanded, "coverageFactor", "2", namespace=SI)
            _add(expanded, "coverageProbability", "0.95", namespace=SI)


def _add_quantity(parent: Element, name: str, value: float, unit: str) -> Element:
    quantity = _add(parent, "quantity")
    _add_text(quantity, "name", name)
    real = _add(quantity, "real", namespace=SI)
    _add(real, "value", _number(value), namespace=SI)
    _add(real, "unit", unit, namespace=SI)
    return real


def _add_temperature(conditions: Element, known: dict[str, int | float]) -> None:
    condition = _add(conditions, "influenceCondition")
    _add_text(condition, "name", "temperature of the sensor")
    data = _add(condition, "data")
    for name, value in known.items():
        _add_quantity(data, name, value, r"\degreecelsius")


def _add_software(softwares: Element, record: CalibrationRecord) -> None:
    software = _add(softwares, "software")
    _add_text(software, "name", "Plumbline")
    _add(software, "release", record.software)


def _add_contact(contact: Element, name: str) -> None:
    _add_text(contact, "name", name)
    _add_text(_add(contact, "location"), "further", NOT_STATED)


def _add_text(parent: Element, name: str, text: str) -> None:
    _add(_add(parent, name), "content", text).set("lang", "en")


def _add(parent: Element, name: str, text: str | None = None, *, namespace: str = DCC) -> Element:
    child = SubElement(parent, f"{{{namespace}}}{name}")
    if text is not None:
        child.text = " ".join(NOT_IN_XML.sub("", text).split()) or NOT_STATED
    return child


def _number(value: float) -> str:
    return f"{float(value):.9g}"
