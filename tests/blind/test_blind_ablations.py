"""A part that is taken away is gone, and is there again afterwards; the table counts what it buys."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.measurement.rig_file import read_rig
from gateway.twin.model import Model, model_of
from gateway.twin.reconcile import reconcile
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import make_observations
from gateway.twin.reconcile.decision import evidence
from gateway.twin.reconcile.search import search
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, make_context
from tests.blind import ablation_table, ablations
from tests.blind.ablation_table import Worth, markdown, worth_of
from tests.blind.ablations import PARTS
from tests.blind.cases import generate
from tests.blind.plan import Plan
from tests.blind.write import write_case
from tests.values import present

pytestmark = pytest.mark.slow

LENGTHS_S = {"log": 24.0, "held_out": 16.0}


@pytest.fixture
def asked(tmp_path: Path) -> Callable[..., Any]:
    """A rig of which is believed what is true, and recordings of it by name."""

    def ask(*hidden: str, seed: int) -> tuple[Model, dict[str, CheckedRecording]]:
        case = generate(Plan(0, seed, "single" if hidden else "null", hidden), LENGTHS_S)
        write_case(case, tmp_path)
        model = model_of(read_rig(tmp_path / "rig.toml"), "rig.toml")
        noise_g = np.full(3, case.rig.noise_g)
        return model, {
            name: CheckedRecording(make_observations(each.time_s, each.force_g, None, noise_g), None, {}, each.time_s)
            for name, each in case.recordings.items()
        }

    return ask


def verdict(model: Model, log: CheckedRecording, held_out: CheckedRecording) -> tuple[str, list[str]]:
    found = reconcile.reconcile(model, log, held_out)
    return found.verdict, [effect.name for effect in found.effects]


def test_without_isolability_one_of_a_group_is_named(asked: Callable[..., Any]) -> None:
    model, recorded = asked("housing_spin", seed=8)
    assert verdict(model, recorded["log"], recorded["held_out"])[0] == "one_of"

    with PARTS["isolability"].off():
        said, names = verdict(model, recorded["log"], recorded["held_out"])
        assert vars(evidence)["rivals_of"](["best", "rival"]) == ["best"]

    assert said == "named"
    assert len(names) == 1


def test_without_held_out_what_one_recording_holds_is_named(asked: Callable[..., Any]) -> None:
    model, recorded = asked("axis_offset", seed=3)
    _, others = asked(seed=3)
    said, _ = verdict(model, recorded["log"], others["held_out"])
    assert said not in ("named", "one_of")

    with PARTS["held-out recording"].off():
        said, names = verdict(model, recorded["log"], others["held_out"])

    assert (said, names) == ("named", ["axis_offset"])


def test_without_drop_what_was_added_stays(asked: Callable[..., Any]) -> None:
    model, recorded = asked(seed=3)
    log = present(recorded["log"].observations)
    context = make_context(model, log, Budget(), lambda: None)
    table = context.fit(context.fit(CandidateTable(log), {}), {"axis_offset": {}}).start_round()
    needless = table.fits[frozenset({"axis_offset"})]
    assert search.eliminate(table, context, needless)[1].names == frozenset()

    with PARTS["elimination"].off():
        assert search.eliminate(table, context, needless)[1].names == {"axis_offset"}


def test_prediction_of_a_command_without_a_gate_is_of_the_held_out_recording(tmp_path: Path) -> None:
    write_case(generate(Plan(0, 3, "single", ("axis_offset",)), LENGTHS_S), tmp_path)
    out, prediction = tmp_path / "out.json", tmp_path / "prediction.csv"
    files = [tmp_path / "log.csv", "--rig", tmp_path / "rig.toml", "--held-out", tmp_path / "held_out.csv"]
    files += ["--json", out, "--prediction", prediction]

    assert ablations.main(["--without", "held-out recording", "reconcile", *map(str, files)]) == 0

    assert json.loads(out.read_text())["gap"]["after"]["held_out"] == pytest.approx(1, abs=0.2)
    with prediction.open(newline="") as file:
        assert len(list(csv.DictReader(file))) == round(LENGTHS_S["held_out"] * 50)


def test_parts_that_did_something_are_told(tmp_path: Path) -> None:
    write_case(generate(Plan(0, 3, "single", ("axis_offset",)), LENGTHS_S), tmp_path)
    acted = tmp_path / "acted.json"
    files = [tmp_path / "log.csv", "--rig", tmp_path / "rig.toml", "--held-out", tmp_path / "held_out.csv"]

    assert ablations.main(["--acted", str(acted), "reconcile", *map(str, files)]) == 0

    told = json.loads(acted.read_text())
    assert "held-out recording" in told
    assert "machine line" not in told
    assert [name for name in told if name.startswith("rule: ")] == []  # the last rule decides


@pytest.mark.parametrize("part", PARTS)
def test_every_part_can_be_taken_away_and_watched(part: str) -> None:
    with PARTS[part].off(), PARTS[part].watched(lambda: None):
        pass


def row(score: str, *acted: str, cpu_s: float = 2.0) -> dict[str, Any]:
    return {"verdict": "named", "named": [score], "group": [], "score": score, "cpu_s": cpu_s, "acted": list(acted)}


def test_worth_counts_cases_won_and_wrong_names_prevented() -> None:
    base = {
        "a": row("right", "growth"),
        "b": row("right", "growth"),
        "c": row("missed", "growth"),
        "d": row("extra_name", "growth"),
        "e": row("right"),
        "f": row("right", "growth"),
    }
    without = {
        "a": row("wrong_name", cpu_s=1.0),
        "b": row("right", cpu_s=1.0),
        "c": row("right_group", cpu_s=1.0),
        "d": row("partly", cpu_s=1.0),
    }

    found = worth_of("growth", base, without)

    assert found == Worth(asked=4, left=1, changed=3, won=1, wrong_prevented=1, lost=1, wrong_caused=1, cpu_ratio=2.0)
    assert (
        "| growth | second and third effects are added to the best one | 4 of 5 | 3 | 1 | 1 | 1 | 1 | 2.00 |"
        in markdown(base, {"growth": without})
    )


def test_a_folder_without_cases_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ablation_table.main([str(tmp_path), "--out", str(tmp_path / "out.json")]) == 2
    assert "no case_* to ask" in capsys.readouterr().err
