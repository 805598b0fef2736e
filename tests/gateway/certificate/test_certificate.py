"""Contents of the certificate, read back from its HTML, and the files of `plumbline calibrate ... --html --dcc`."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.digital_certificate import render_digital_certificate
from gateway.certificate.page import render_certificate
from gateway.cli.main import main
from tests.gateway.certificate.conftest import make_record

VOID = {"meta"}
HOSTILE = "</style><script>alert(1)</script><img src=x onerror=alert(2)>\"'&amp;\u202e\x00"
SESSION = Path(__file__).parents[2] / "data" / "calibration" / "six_faces_session.csv"
OPTIONS = ["--rate", "204.8", "--device-id", "part-7"]


class Page(HTMLParser):
    """Texts of all elements, rows of all tables, and how the markup nests."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.rows: list[list[str]] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" in self.open:
            return
        self.words.append(data)
        if "th" in self.open or "td" in self.open:
            self.rows[-1][-1] += data

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def row(self, head: str, table: int = 0) -> list[str]:
        return [row for row in self.rows if row[0] == head][table]

    def poses(self) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.tags if "data-pose" in attributes and tag == "g"]


def number(text: str) -> float:
    return float(text.replace("−", "-"))


def test_certificate_identifies_device_record_and_author() -> None:
    record = make_record(reason="quarterly", parent="p-7")
    page = Page(render_certificate(record, None))
    for said in (
        *(record.id, record.device_id, record.method, record.created_utc, record.by, record.sha256, "p-7", "quarterly"),
        *(
            "plumbline 0.1.0",
            "21.6 °C (20.9 to 22.3 °C)",
            "12 of 12",
            "dm = ± 3.1 mg",
            "The procedure gave no warning.",
        ),
    ):
        assert said in page.text, said
    assert "The parent record is not available" in page.text


def test_offset_and_matrix_have_the_digits_that_their_uncertainty_supports() -> None:
    record = make_record()
    page = Page(render_certificate(record, None))
    x = page.row("x")
    assert x[1] == "7680 ± 100"
    sensitivity = np.linalg.inv(np.array(record.correction_matrix))[0, 0]
    value, expanded = (float(text) for text in x[2].split(" ± "))
    relative = 1e-9 / record.correction_matrix[0][0]
    assert value == pytest.approx(sensitivity, abs=expanded / 10)
    assert expanded == pytest.approx(2 * sensitivity * relative, rel=0.05)
    assert "The matrix is in 10⁻⁶ g/counts" in page.text
    assert [number(text.split(" ± ")[0]) for text in x[3:6]] == pytest.approx(
        1e6 * np.array(record.correction_matrix[0]), abs=1e-4
    )
    assert x[3].endswith("± 0.0020")
    assert x[6] == "1.318; −1.579"


def test_combined_uncertainty_is_the_root_sum_of_squares() -> None:
    page = Page(render_certificate(make_record(), None))
    assert page.row("noise of the pose means")[1:] == ["A", "0.3", "0.017"]
    assert page.row("combined, u")[2:] == ["0.5", "0.0286"]
    assert page.row("expanded, U (k = 2)")[2:] == ["1", "0.0572"]


def test_budget_rows_that_do_not_fit_are_included_in_the_sums() -> None:
    rows = [{"source": f"source {row}", "type": "B", "u_g": 0.001 * row, "u_deg": 0.0} for row in range(12)]
    page = Page(render_certificate(make_record(budget=rows), None))
    assert page.row("source 11")
    assert page.row("5 smaller ones, in the sums")
    assert float(page.row("combined, u")[2]) == pytest.approx(np.sqrt(sum(row**2 for row in range(12))), rel=0.01)


def test_residual_plot_shows_every_pose_at_its_residual() -> None:
    record = make_record()
    far = dict(record.poses[3], mean=(np.array(record.poses[3]["mean"]) * 1.01).tolist())
    unused = dict(record.poses[5], used=False)
    record = make_record(poses=[*record.poses[:3], far, record.poses[4], unused, *record.poses[6:], {"mean": "x"}])
    page = Page(render_certificate(record, None))
    assert [entry["data-pose"] for entry in page.poses()] == [str(number) for number in range(1, 13)]
    assert [number for number, entry in enumerate(page.poses(), 1) if "unused" in str(entry["class"])] == [6]
    circles = [attributes for tag, attributes in page.tags if tag == "circle"]
    heights = np.array([float(str(circle["cy"])) for circle in circles])
    corrected = [
        np.array(record.correction_matrix) @ (np.array(pose["mean"]) - np.array(record.offset))
        for pose in record.poses[:12]
    ]
    residual_mg = 1000 * (np.linalg.norm(corrected, axis=1) - 1)
    slope, middle = np.polyfit(residual_mg, heights, 1)
    assert slope < 0  # up is more
    np.testing.assert_allclose(heights, middle + slope * residual_mg, atol=0.01)
    bars = [attributes for tag, attributes in page.tags if tag == "line" and attributes.get("class") == "bar"]
    lengths = np.array([float(str(bar["y1"])) - float(str(bar["y2"])) for bar in bars])
    np.testing.assert_allclose(lengths, -slope * 4 * 0.1, rtol=0.05)  # 4 u of 0.1 mg each
    assert "1 of 11 used poses beyond 3 u" in page.text
    assert "1 poses are not shown" in page.text
    assert "12 of 13" in page.text


def test_record_without_poses_has_placeholders() -> None:
    page = Page(render_certificate(make_record(method="zero", poses=[], budget=[]), None))
    assert "contains no poses" in page.text
    assert "contains no uncertainty budget" in page.text
    assert "removes offset and mount angle together" in page.text
    assert page.poses() == []


def test_change_since_the_parent_is_given_in_mg_and_degrees(
    drifted: tuple[CalibrationRecord, CalibrationRecord],
) -> None:
    record, parent = drifted
    page = Page(render_certificate(record, parent))
    x, z = page.row("x", table=1), page.row("z", table=1)
    assert [float(text) for text in z[1].split(" ± ")] == pytest.approx(
        [4.0, 2 * 1000 * np.sqrt(2) * 50 / 256_000 / 1.013], rel=0.03
    )
    assert float(x[2].split(" ± ")[0]) == pytest.approx(2.0, abs=0.01)
    assert float(z[3]) == pytest.approx(np.degrees(np.arcsin(0.004)), abs=0.001)
    assert (x[5], z[5], page.row("y", table=1)[5]) == ("scale", "offset", "no")
    assert "tilt error of up to 0.229° on its worst axis" in page.text
    assert re.search(r"Recalibrate within \d+ days: by then the error of axis z may reach 0.5°", page.text)
    assert "from 2 records over 91 days" in page.text
    assert "cannot be checked" in page.text


def test_forecast_uses_all_earlier_records(drifted: tuple[CalibrationRecord, CalibrationRecord]) -> None:
    record, parent = drifted
    earlier = [make_record(id=f"p{month}", created_utc=f"2025-{month:02d}-01T00:00:00Z") for month in (3, 6, 9)]
    assert "from 5 records" in Page(render_certificate(record, parent, [*earlier, parent])).text


def test_two_records_of_one_day_give_no_forecast(drifted: tuple[CalibrationRecord, CalibrationRecord]) -> None:
    record, _ = drifted
    same_day = make_record(id=record.parent, created_utc=record.created_utc[:10] + "T01:00:00Z")
    text = Page(render_certificate(record, same_day)).text
    assert "2 calibrations within a day show their repeatability and nothing about ageing" in text
    assert "Recalibrate within" not in text


def test_negligible_contribution_is_printed_as_a_bound() -> None:
    row = {"source": "quantisation", "type": "B", "u_g": 4.6e-35, "u_deg": 0}
    assert "< 1e-06" in Page(render_certificate(make_record(budget=[row]), None)).text


def test_zeroed_record_gives_its_change_without_uncertainty(
    drifted: tuple[CalibrationRecord, CalibrationRecord],
) -> None:
    _, parent = drifted
    turned = np.array([[1, 0, 0.02], [0, 1, 0], [-0.02, 0, 1]]) @ np.array(parent.correction_matrix)
    page = Page(
        render_certificate(make_record(method="zero", parent="parent-1", correction_matrix=turned.tolist()), parent)
    )
    y = page.row("y", table=1)
    assert abs(number(y[4])) == pytest.approx(np.degrees(0.02), abs=0.01)
    assert y[5] == "—"
    assert "it measured neither" in page.text
    assert "No forecast" in page.text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"device_id": "other"}, "Not compared: records of other and adxl355"),
        ({"unit": "g"}, "Not compared: records parent-1 in g"),
        ({"created_utc": "soon"}, "No forecast: record parent-1: created_utc 'soon'"),
        ({"id": "p-2"}, "compared with record p-2, but the parent that this record names is parent-1"),
        ({"correction_matrix": np.zeros((3, 3)).tolist()}, "rotation about the axis"),
    ],
)
def test_incompatible_parent_is_reported_and_the_rest_is_shown(
    drifted: tuple[CalibrationRecord, CalibrationRecord], changes: dict[str, Any], said: str
) -> None:
    parent = make_record(**{"id": "parent-1", "created_utc": "2026-01-01T09:12:41Z"} | changes)
    page = Page(render_certificate(drifted[0], parent))
    assert said in page.text
    assert "Limits of this certificate" in page.text


def test_singular_matrix_is_a_warning() -> None:
    page = Page(render_certificate(make_record(correction_matrix=[[1, 0, 0], [0, 0, 0], [0, 0, 1]]), make_record()))
    assert "must not be used" in page.text
    assert "1 warning" not in page.text  # the parent is not the one that is named either
    assert "2 warnings" in page.text


def test_warnings_are_alerts_and_hidden_ones_are_counted() -> None:
    page = Page(render_certificate(make_record(warnings=["one face is missing"]), None))
    ((_, attributes),) = [(tag, found) for tag, found in page.tags if found.get("role") == "alert"]
    assert attributes["class"] == "warnings"
    assert "⚠ 1 warning one face is missing" in page.text
    page = Page(render_certificate(make_record(warnings=[f"warning {number}" for number in range(9)]), None))
    assert "⚠ 9 warnings" in page.text
    assert "and 5 more warnings" in page.text


def test_limits_depend_on_the_record() -> None:
    page = Page(render_certificate(make_record(temperature_c=None, method="six-position"), None))
    assert "it is not known" in page.text
    assert "absorbs a tilt of the whole table" in page.text
    assert "It is no signature" in page.text
    assert "Outside 20.9 to 22.3 °C" in Page(render_certificate(make_record(), None)).text


def test_hostile_text_never_becomes_markup() -> None:
    record = make_record(
        id=HOSTILE,
        by=HOSTILE,
        device_id=HOSTILE,
        method=HOSTILE,
        software=HOSTILE,
        created_utc=HOSTILE,
        reason=HOSTILE,
        parent=HOSTILE,
        warnings=[HOSTILE],
        budget=[{"source": HOSTILE, "type": "A", "u_g": 0.001, "u_deg": 0.1}],
        poses=[{"mean": [8000, -5000, 270_000], "type_a": [1, 1, 1], "count": 3, "face": HOSTILE, "used": True}],
    )
    text = render_certificate(record, make_record(id=HOSTILE, created_utc=HOSTILE, device_id=HOSTILE))
    page = Page(text)
    assert {tag for tag, _ in page.tags} & {"script", "img"} == set()
    assert not any(name.startswith("on") for _, attributes in page.tags for name in attributes)
    assert "<script>alert(1)</script>" in page.text
    assert not set(text) & {"\u202e", "\x00"}
    text.encode()


def test_certificate_loads_nothing() -> None:
    page = Page(render_certificate(make_record(), None))
    assert not any({"src", "href", "xlink:href"} & set(attributes) for _, attributes in page.tags)
    ((_, policy),) = [(tag, found) for tag, found in page.tags if found.get("http-equiv")]
    assert policy["content"] == "default-src 'none'; style-src 'unsafe-inline'"


@pytest.mark.parametrize("value", [5e-324, 1e-150, 1e150, 1e300])
def test_overflowing_numbers_are_dashes(value: float) -> None:
    record = make_record(
        offset=[value] * 3,
        covariance=(value * np.eye(12)).tolist(),
        prediction_interval_g=value,
        residual_rms_g=value,
        temperature_c={"mean": value},
        poses=[
            {"mean": [value] * 3, "type_a": [value] * 3, "face": "+x"},
            {"mean": [1, 2, 3], "type_a": [0, 0, 0]},
            {},
        ],
        budget=[{"source": "", "type": "A", "u_g": value, "u_deg": value}],
    )
    changed = make_record(correction_matrix=(value * np.eye(3)).tolist(), parent="p")
    for page in (
        render_certificate(record, make_record()),
        render_certificate(changed, record),
        render_certificate(changed, changed),
    ):
        assert Page(page).row("combined, u")


def test_same_record_gives_the_same_page(drifted: tuple[CalibrationRecord, CalibrationRecord]) -> None:
    assert render_certificate(*drifted) == render_certificate(*drifted)


@pytest.mark.slow
def test_calibrate_writes_the_certificate_of_its_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    page = tmp_path / "second.html"
    main(["calibrate", "six-position", str(SESSION), *OPTIONS, "--json", str(first)])
    written = [
        "--parent",
        str(first),
        "--json",
        str(second),
        "--html",
        str(page),
        "--dcc",
        str(page.with_suffix(".xml")),
    ]
    main(["calibrate", "six-position", str(SESSION), *OPTIONS, *written])
    capsys.readouterr()
    parent, record = (CalibrationRecord.model_validate(json.loads(path.read_text())) for path in (first, second))
    assert page.read_text() == render_certificate(record, parent)
    assert "Change since the parent" in page.read_text()
    assert page.with_suffix(".xml").read_text() == render_digital_certificate(record)
