"""`plumbline calibrate ... --html --dcc` on a real recording."""

import json
from pathlib import Path

import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.digital_certificate import render_digital_certificate
from gateway.certificate.page import render_certificate
from gateway.cli.main import main

SESSION = Path(__file__).parents[2] / "data" / "calibration" / "six_faces_session.csv"
OPTIONS = ["--rate", "204.8", "--device-id", "part-7"]


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
