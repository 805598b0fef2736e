"""`plumbline reconcile --plan RIG`, as it is called."""

import json
from argparse import Namespace
from pathlib import Path

import pytest

from gateway.cli.main import parser
from gateway.cli.plan import run_plan, wants_plan
from gateway.errors import InputError

BELIEFS = "[rope]\nlength_m = 12.0\n[housing]\nposition_m = 5.0\n[sensor]\nsample_rate_hz = 50\nnoise_g = 0.001\n"


@pytest.fixture
def rig(tmp_path: Path) -> str:
    path = tmp_path / "rig.toml"
    path.write_text(BELIEFS)
    return str(path)


def parsed(*words: str) -> Namespace:
    return parser().parse_args(["reconcile", *words])


@pytest.mark.slow
def test_a_plan_is_told_and_written(rig: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "plan.json"
    arguments = parsed("--plan", rig, "--effects", "steady_wind,axis_offset[x+y]", "--json", str(out))
    assert wants_plan(arguments)
    assert run_plan(arguments) == 0
    assert "turn the housing evenly about the rope" in capsys.readouterr().out
    (group,) = json.loads(out.read_text())["groups"]
    assert group["told_apart"]
    assert group["effects"] == ["steady_wind", "axis_offset[x+y]"]


@pytest.mark.slow
def test_the_answer_is_no_where_nothing_helps(rig: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_plan(parsed("--plan", rig, "--effects", "slewing,housing_spin")) == 1
    assert "none of the" in capsys.readouterr().out


def test_a_recording_is_wanted_where_no_plan_is(rig: str) -> None:
    assert not wants_plan(parsed("log.csv"))
    for words, said in (
        ([], "wants a recording"),
        (["log.csv", "--plan", rig], "looks at no recording"),
        (["log.csv", "--effects", "impact,hoisting"], "belongs to --plan"),
    ):
        with pytest.raises(InputError, match=said):
            wants_plan(parsed(*words))
