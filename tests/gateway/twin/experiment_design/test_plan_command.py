"""`plumbline reconcile --plan RIG` on the command line."""

import json
from pathlib import Path

import pytest

from gateway.cli.main import main

RIG_FILE = "[rope]\nlength_m = 12.0\n[housing]\nposition_m = 5.0\n[sensor]\nsample_rate_hz = 50\nnoise_g = 0.001\n"


@pytest.fixture
def rig(tmp_path: Path) -> str:
    path = tmp_path / "rig.toml"
    path.write_text(RIG_FILE)
    return str(path)


@pytest.mark.slow
def test_plan_is_printed_and_written(rig: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "plan.json"
    code = main(["reconcile", "--plan", rig, "--effects", "steady_wind,axis_offset[x+y]", "--json", str(out)])
    assert code == 0
    assert "turn the housing evenly about the rope" in capsys.readouterr().out
    (group,) = json.loads(out.read_text())["groups"]
    assert group["told_apart"]
    assert group["effects"] == ["steady_wind", "axis_offset[x+y]"]


@pytest.mark.slow
def test_exit_code_is_1_if_no_experiment_separates_anything(rig: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reconcile", "--plan", rig, "--effects", "slewing,housing_spin"]) == 1
    assert "none of the" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "needs a recording"),
        (["log.csv", "--plan", "rig.toml"], "reads no recording"),
        (["log.csv", "--effects", "impact,hoisting"], "belongs to --plan"),
    ],
)
def test_recording_and_plan_exclude_each_other(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["reconcile", *arguments]) == 2
    assert message in capsys.readouterr().err
