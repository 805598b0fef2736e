"""`--json -` prints the result as JSON, and nothing else, on the standard output."""

import json
from pathlib import Path

import pytest

from gateway.cli.main import main

SESSION = Path(__file__).parents[2] / "data" / "calibration" / "six_faces_session.csv"


def test_a_calibration_record_on_the_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["calibrate", "six-position", str(SESSION), "--rate", "100", "--unit", "counts"]
    assert main([*arguments, "--json", "-"]) in (0, 1)
    record = json.loads(capsys.readouterr().out)
    assert record["method"] == "six-position"
    assert list(tmp_path.iterdir()) == []
