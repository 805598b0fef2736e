"""Scores against the rules in words; the campaign against something that always gives the same answer."""

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.blind import campaign, confusion, kept, score
from tests.blind.asking import ask
from tests.blind.cases import generate
from tests.blind.plan import Plan
from tests.blind.score import Answer, judge
from tests.blind.write import write_case
from tests.waiting import PATIENCE_S, wait_until

ROOT = Path(__file__).parents[2]
GUESSER = """
import argparse, json, shutil, time
parser = argparse.ArgumentParser()
for name in ("verb", "log", "--rig", "--held-out", "--json", "--prediction"):
    parser.add_argument(name)
chosen = parser.parse_args()
answer = {"verdict": "none_missing", "effects": [], "candidates": [], "gap": {"before": {"log": 1.0, "held_out": 1.0}}}
json.dump(answer, open(chosen.json, "w"))
shutil.copy(chosen.held_out, chosen.prediction)
time.sleep(1)  # its memory is looked at while it runs
"""


def judged(
    truth: str,
    verdict: str,
    named: Sequence[str] = (),
    group: Sequence[str] = (),
    equivalents: Mapping[str, str] | None = None,
) -> str:
    answer = Answer(verdict, frozenset(named), frozenset(group), equivalents or {}, None)
    return judge(frozenset(truth.split()), answer)


@pytest.mark.parametrize(
    ("truth", "named", "group", "worth"),
    [
        ("load_inertia", ["rope_length"], [], "right_group"),
        ("rope_length", ["rope_length"], [], "right"),
        ("load_inertia", [], ["clock_drift", "rope_length"], "right_group"),
        ("load_inertia", ["rope_length", "vibration"], [], "wrong_name"),
        ("load_inertia vibration", ["rope_length", "vibration"], [], "beside_group"),
        ("slewing", ["rope_length"], [], "wrong_name"),
    ],
)
def test_effect_stated_beside_a_name_as_equivalent_counts_as_one_of_a_group(
    truth: str, named: list[str], group: list[str], worth: str
) -> None:
    verdict = "one_of" if group else "named"
    assert judged(truth, verdict, named, group, {"load_inertia": "rope_length"}) == worth


@pytest.mark.parametrize(
    ("truth", "verdict", "named", "group", "worth"),
    [
        ("", "none_missing", [], [], "right"),
        ("", "named", ["axis_offset"], [], "false_alarm"),
        ("", "data_unusable", [], [], "false_alarm"),
        ("hoisting", "named", ["hoisting"], [], "right"),
        ("hoisting", "named_with_remainder", ["hoisting"], [], "right"),
        ("hoisting", "named", ["impact"], [], "wrong_name"),
        ("hoisting", "named", ["hoisting", "impact"], [], "extra_name"),
        ("hoisting", "none_missing", [], [], "missed"),
        ("hoisting", "one_of", [], ["hoisting", "impact"], "right_group"),
        ("hoisting", "one_of", [], ["hoisting", "axis_offset"], "wrong_group"),
        ("axis_offset", "one_of", [], ["steady_wind", "cross_axis"], "right_group"),
        ("impact clock_drift", "one_of", ["impact"], ["clock_drift", "rope_length"], "beside_group"),
        ("impact clock_drift", "one_of", ["impact"], ["slewing", "housing_spin"], "wrong_group"),
        ("impact clock_drift", "one_of", ["hoisting"], ["clock_drift", "rope_length"], "wrong_name"),
        ("vibration hoisting", "named", ["vibration"], [], "partly"),
        ("vibration hoisting", "named", ["hoisting", "vibration"], [], "right"),
        ("backlash", "unmodelled", [], [], "right"),
        ("backlash", "named_with_remainder", ["cross_axis"], [], "wrong_name"),
        ("backlash", "none_missing", [], [], "missed"),
        ("thermal_drift thermal_saturation", "named_with_remainder", ["thermal_drift"], [], "right"),
        ("thermal_drift thermal_saturation", "named", ["thermal_drift"], [], "wrong_name"),
    ],
)
def test_judgement(truth: str, verdict: str, named: list[str], group: list[str], worth: str) -> None:
    assert judged(truth, verdict, named, group) == worth


def test_gap_closed_is_measured_above_the_noise() -> None:
    assert score.closed_percent(11.0, 1.5) == pytest.approx(95.0)
    assert score.closed_percent(1.01, 1.0) is None


@pytest.fixture
def case(tmp_path: Path) -> Path:
    folder = tmp_path / "case_000"
    write_case(generate(Plan(0, 6, "single", ("axis_offset",)), {"log": 8.0, "held_out": 6.0}), folder)
    return folder


def shifted(case: Path, path: Path, by_g: float, rows: int | None = None) -> Path:
    with (case / "held_out.csv").open(newline="") as file:
        lines = list(csv.reader(file))[:rows]
    path.write_text(
        "\n".join([",".join(lines[0])] + [f"{t},{float(x) + by_g},{y},{z},{c}" for t, x, y, z, c in lines[1:]])
    )
    return path


@pytest.mark.slow
def test_prediction_is_compared_with_the_held_out_recording(case: Path, tmp_path: Path) -> None:
    off_g = 3 * 0.0003
    noise = tomllib.loads((case / "rig.toml").read_text())["sensor"]["noise_g"]
    chi2 = score.held_out_chi2(case, shifted(case, tmp_path / "p.csv", off_g))
    assert chi2 == pytest.approx((off_g / noise) ** 2 / 3)
    with pytest.raises(ValueError, match="the prediction has 9 rows, the recording 300"):
        score.held_out_chi2(case, shifted(case, tmp_path / "short.csv", 0.0, rows=10))


def test_noise_free_readings_at_the_rail_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("[sensor]\nnoise_g = 0.001\n")
    header = "time_s,ax_g,ay_g,az_g\n"
    (tmp_path / "held_out.csv").write_text(header + "0,0.001,0.001,1.0\n1,0.001,0.001,0.9\n")
    exact, missing = tmp_path / "exact.csv", tmp_path / "missing.csv"
    exact.write_text(header + "0,0,0,1.0\n1,0,0,0.9\n")
    missing.write_text(header + "0,0,0,1.01\n1,0,0,0.9\n")
    assert score.held_out_chi2(tmp_path, exact) == pytest.approx(4 / 6)
    assert score.held_out_chi2(tmp_path, exact, full_scale_g=1.0) == pytest.approx(4 / 5)
    assert score.held_out_chi2(tmp_path, missing, full_scale_g=1.0) == pytest.approx(104 / 6)


@pytest.fixture
def guesser(tmp_path: Path) -> str:
    script = tmp_path / "guesser.py"
    script.write_text(GUESSER)
    return shlex.join([sys.executable, str(script)])


@pytest.mark.slow
def test_campaign_asks_scores_goes_on_and_refuses_another(
    guesser: str, case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, page = tmp_path / "results.json", tmp_path / "results.md"
    arguments = ["--folder", str(case.parent), "--jobs", "1", "--out", str(out), "--report", str(page)]
    assert campaign.main([*arguments, "--command", guesser]) == 0
    first = json.loads(out.read_text())
    (row,) = first["rows"]
    assert (row["truth"], row["verdict"], row["score"]) == (["axis_offset"], "none_missing", "copied")
    assert row["peak_mib"] > 0
    assert "| axis_offset | 1 |" in page.read_text()
    out.write_text(json.dumps(first | {"rows": [row | {"why": "kept"}]}))
    assert campaign.main([*arguments, "--command", guesser]) == 0
    assert json.loads(out.read_text())["rows"][0]["why"] == "kept"
    out.write_text(json.dumps(first | {"rows": [row | {"score": "crash", "why": "no memory"}]}))
    assert campaign.main([*arguments, "--command", guesser]) == 0
    (again,) = json.loads(out.read_text())["rows"]
    assert (again["score"], again["why"]) == ("copied", "")
    assert campaign.main([*arguments, "--command", "another"]) == 2
    assert "holds another campaign" in capsys.readouterr().err


@pytest.mark.slow
def test_what_ran_out_of_time_is_an_answer(guesser: str, case: Path, tmp_path: Path) -> None:
    out = tmp_path / "results.json"
    arguments = ["--folder", str(case.parent), "--jobs", "1", "--out", str(out), "--command", guesser]
    assert campaign.main([*arguments, "--timeout", "0.1"]) == 0
    assert campaign.main(arguments) == 0
    told = json.loads(out.read_text())
    assert [row["score"] for row in told["rows"]] == ["timeout"]
    assert (told["summary"]["out_of_time"], told["summary"]["crashed"]) == (1, 0)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--folder", "{}"], "there is no case_* in it"),
        (["--cases-dir", "{}/cases", "--cases", "3"], "holds another campaign's case_000"),
    ],
)
def test_what_does_not_go_together_is_refused(
    words: list[str], fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_truth(tmp_path / "cases" / "case_000", {"seed": 1, "effects": {}})
    arguments = [word.format(tmp_path) for word in words]
    assert campaign.main([*arguments, "--out", str(tmp_path / "out.json")]) == 2
    assert fault in capsys.readouterr().err
    assert not (tmp_path / "out.json").exists()


def write_truth(folder: Path, truth: dict[str, dict[Any, Any] | int]) -> None:
    folder.mkdir(parents=True)
    (folder / "truth.json").write_text(json.dumps(truth))


def test_kept_case_is_used_again_and_a_half_written_one_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Plan] = []
    monkeypatch.setattr(kept, "generate", made.append)
    monkeypatch.setattr(kept, "write_case", lambda _case, folder: write_truth(folder, {"seed": 6, "effects": {}}))
    plan = Plan(3, 6, "null")
    (tmp_path / "case_002").mkdir()
    assert [kept.make(plan, tmp_path) for _ in range(2)] == [tmp_path / "case_003"] * 2
    assert made == [plan]
    assert kept.of_others([Plan(2, 6, "null"), plan], tmp_path) == []
    assert kept.of_others([Plan(3, 7, "null")], tmp_path) == ["case_003"]


@pytest.mark.slow
def test_facts_are_those_of_the_truth_whoever_made_the_case(case: Path) -> None:
    facts = kept.facts_of(case)
    assert (facts["seed"], facts["kind"], facts["coloured"], facts["jittered"]) == (6, "single", False, False)
    assert facts["excess"]["axis_offset"] > 0.03


@pytest.mark.slow
def test_a_loss_tells_how_near_the_truth_came(case: Path, tmp_path: Path) -> None:
    script = tmp_path / "wrong.py"
    said = {"verdict": "named", "reason": "nothing else does", "effects": [{"name": "impact"}], "candidates": []}
    said["ranking"] = [
        {"names": ["impact"], "chi2_log": 1.0, "chi2_held_out": 1.0, "behind": 0.0},
        {"names": ["axis_offset"], "chi2_log": 1.004, "chi2_held_out": None, "behind": 13.2},
    ]
    script.write_text(
        f"import json, sys; json.dump(json.loads('{json.dumps(said)}'), open(sys.argv[sys.argv.index('--json') + 1], 'w'))"
    )
    row = ask(case, [sys.executable, str(script)], 30.0)
    assert row["score"] == "wrong_name"
    assert row["why"].endswith("; nothing else does; the truth is 13.2 behind the best (1.00, -)")


@pytest.mark.slow
def test_command_that_fails_is_a_crash_with_its_last_words(case: Path, tmp_path: Path) -> None:
    script = tmp_path / "failing.py"
    script.write_text("import sys; sys.exit('no such thing')")
    row = ask(case, [sys.executable, str(script)], 30.0)
    assert (row["score"], row["why"]) == ("crash", "exit code 1: no such thing")


@pytest.mark.slow
def test_command_that_takes_too_long_is_ended(case: Path, tmp_path: Path) -> None:
    script = tmp_path / "endless.py"
    script.write_text("while True: pass")
    assert ask(case, [sys.executable, str(script)], 0.3)["score"] == "timeout"


@pytest.mark.slow
def test_stopped_campaign_leaves_nothing_running(case: Path, tmp_path: Path) -> None:
    running, script = tmp_path / "running", tmp_path / "endless.py"
    script.write_text(
        f"import os, pathlib\npathlib.Path({str(running)!r}).write_text(str(os.getpid()))\nwhile True: pass"
    )
    command = shlex.join([sys.executable, str(script)])
    arguments = ["--folder", str(case.parent), "--jobs", "1", "--out", str(tmp_path / "out.json"), "--command", command]
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.blind.campaign", *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: running.exists() and running.read_text(), "the command to run")
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert b"the same command goes on from here" in told
    with pytest.raises(ProcessLookupError):
        os.kill(int(running.read_text()), 0)


def test_page_shows_every_answer() -> None:
    row = {"case": "case_000", "seed": 1, "kind": "single", "truth": ["impact"], "named": ["wind_gust"], "group": []}
    row |= {
        "verdict": "named",
        "score": "wrong_name",
        "closed_percent": 80.0,
        "seconds": 3.0,
        "cpu_s": 2.5,
        "peak_mib": 200.0,
        "why": "",
    }
    row |= {
        "coloured": False,
        "jittered": False,
        "small": True,
        "excess": {"impact": 3.0},
        "chi2_before": 9.0,
        "chi2_after": 2.6,
    }
    page = confusion.markdown([row])
    assert "| confident wrong name | 100.0 % |" in page
    assert "| hidden | wind_gust |\n| --- | --- |\n| impact | 1 |" in page
    assert "| case_000 | 1 | wrong_name | impact | 3 | wind_gust | 9.00 → 2.60 |" in page
