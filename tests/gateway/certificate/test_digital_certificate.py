"""The digital calibration certificate: its structure, and its numbers read back from the XML."""

from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np
import pytest

from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.certificate.digital_certificate import DCC, SI, render_digital_certificate
from gateway.numerics.array import Array
from tests.gateway.certificate.conftest import OFFSET, SENSITIVITY, U_OFFSET, make_record
from tests.gateway.certificate.dcc_structure import find_problems

NAMES = {"dcc": DCC, "si": SI}
G_M_S2 = 9.80665
HOSTILE = "\x07 <script>alert(1)</script> & ]]> \x00\ud800 " + "x" * 500


def parse(record: CalibrationRecord) -> ElementTree.Element:
    return ElementTree.fromstring(render_digital_certificate(record))


def quantities(root: ElementTree.Element, name: str, what: str = "value") -> Array:
    """Return numbers of the result with a name."""
    for result in root.iterfind(".//dcc:result", NAMES):
        if result.findtext("dcc:name/dcc:content", namespaces=NAMES) == name:
            return np.array([float(each.text or "") for each in result.iterfind(f".//si:{what}", NAMES)])
    raise AssertionError(name)


def declarations(root: ElementTree.Element) -> str:
    return " ".join(each.text or "" for each in root.iterfind(".//dcc:declaration/dcc:content", NAMES))


@pytest.mark.parametrize("unit", ["counts", "V", "g"])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"temperature_c": None, "budget": [], "warnings": ["bent", "late"]},
        {"by": HOSTILE, "device_id": HOSTILE, "software": "", "method": "zero", "warnings": [HOSTILE, ""]},
    ],
)
def test_the_document_has_the_structure_of_the_schema(unit: str, changes: dict[str, Any]) -> None:
    assert find_problems(parse(make_record(unit=unit, **changes))) == []


def test_the_structure_rejects_what_the_schema_rejects() -> None:
    root = parse(make_record())
    core = root.find("dcc:administrativeData/dcc:coreData", NAMES)
    assert core is not None
    core.insert(0, core[-1])
    core[1].text = "Germany"
    assert [problem.split(":")[0] for problem in find_problems(root)] == ["coreData", "countryCodeISO3166_1"]


@pytest.mark.parametrize(("unit", "raw_si"), [("counts", 1.0), ("V", 1.0), ("g", G_M_S2)])
def test_values_and_expanded_uncertainties_are_those_of_the_record_in_si(
    unit: Literal["g", "V", "counts"], raw_si: float
) -> None:
    root = parse(make_record(unit=unit))
    np.testing.assert_allclose(quantities(root, "zero-g offset"), OFFSET * raw_si)
    np.testing.assert_allclose(quantities(root, "zero-g offset", "uncertainty"), 2 * U_OFFSET * raw_si)
    per_g = np.diag(SENSITIVITY)
    np.testing.assert_allclose(quantities(root, "sensitivity"), per_g * raw_si / G_M_S2, rtol=1e-6)
    matrix = np.linalg.inv(SENSITIVITY) * G_M_S2 / raw_si
    np.testing.assert_allclose(quantities(root, "correction matrix"), matrix.ravel(), rtol=1e-6)
    np.testing.assert_allclose(quantities(root, "prediction interval of a corrected reading"), [0.0031 * G_M_S2])
    by_cause = quantities(root, "standard uncertainty of a corrected reading, by cause")
    np.testing.assert_allclose(by_cause, np.array([0.0003, 0.0004]) * G_M_S2)
    assert {each.text for each in root.iterfind(".//si:coverageFactor", NAMES)} == {"2"}


def test_reference_operator_environment_software_and_decision_rule_are_stated() -> None:
    root = parse(make_record())
    said = " ".join(root.itertext())
    for text in ("local gravity, taken as 1 g", "A. Rigger", "Plumbline", "No statement of conformity", "k = 2"):
        assert text in said, text
    (condition,) = root.iterfind(".//dcc:influenceCondition", NAMES)
    assert [each.text for each in condition.iterfind(".//si:value", NAMES)] == ["21.6", "20.9", "22.3"]


def test_a_record_that_is_judged_by_limits_states_the_guard_band() -> None:
    thermal = {"summary": [{"axis": "x", "verdict": "within"}]}
    assert "guard band w = U" in declarations(parse(make_record(method="thermal", thermal=thermal)))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"created_utc": "yesterday"}, "yesterday"),
        ({"correction_matrix": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]}, "singular"),
    ],
)
def test_a_record_that_cannot_be_stated_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(CalibrationError, match=said):
        render_digital_certificate(make_record(**changes))
