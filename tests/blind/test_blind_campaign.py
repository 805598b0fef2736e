"""Scores against the rules in words; the campaign against something that always gives the same answer."""

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.blind import campaign, confusion, score
from tests.blind.plan import Plan
from tests.blind.score import Answer, judge

ROOT = Path(__file__).parents[2]
PATIENCE_S = 60.0
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


def judged(truth, verdict, named=(), group=()):
    return judge(frozenset(truth.split()), Answer(verdict, frozenset(named), frozenset(group), None))


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
        ("vibration hoisting", "named", ["vibration"], [], "partly"),
        ("vibration hoisting", "named", ["hoisting", "vibration"], [], "right"),
        ("backlash", "unmodelled", [], [], "right"),
        ("backlash", "named_with_remainder", ["cross_axis"], [], "wrong_name"),
        ("backlash", "none_missing", [], [], "missed"),
        ("thermal_drift thermal_saturation", "named_with_remainder", ["thermal_drift"], [], "right"),
        ("thermal_drift thermal_saturation", "named", ["thermal_drift"], [], "wrong_name"),
    ],
)
def test_judgement(truth, verdict, named, group, worth):
    assert judged(truth, verdict, named, group) == worth


def test_gap_closed_is_measured_above_the_noise():
    assert score.closed_percent(11.0, 1.5) == pytest.approx(95.0)
    assert score.closed_percent(1.01, 1.0) is None


@pytest.fixture
def case(tmp_path):
    folder = tmp_path / "case_000"
    campaign.write_case(
        campaign.generate(Plan(0, 6, "single", ("axis_offset",)), {"log": 8.0, "held_out": 6.0}), folder
    )
    return folder


def shifted(case, path, by_g, rows=None):
    with (case / "held_out.csv").open(newline="") as file:
        lines = list(csv.reader(file))[:rows]
    path.write_text(
        "\n".join([",".join(lines[0])] + [f"{t},{float(x) + by_g},{y},{z},{c}" for t, x, y, z, c in lines[1:]])
    )
    return path


def test_prediction_is_compared_with_the_held_out_recording(case, tmp_path):
    off_g = 3 * 0.0003
    noise = score.tomllib.loads((case / "rig.toml").read_text())["sensor"]["noise_g"]
    chi2 = score.held_out_chi2(case, shifted(case, tmp_path / "p.csv", off_g))
    assert chi2 == pytest.approx((off_g / noise) ** 2 / 3)
    with pytest.raises(ValueError, match="the prediction has 9 rows, the recording 300"):
        score.held_out_chi2(case, shifted(case, tmp_path / "short.csv", 0.0, rows=10))


def test_noise_free_readings_at_the_rail_do_not_count(tmp_path):
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
def guesser(tmp_path):
    script = tmp_path / "guesser.py"
    script.write_text(GUESSER)
    return shlex.join([sys.executable, str(script)])


def test_campaign_asks_scores_goes_on_and_refuses_another(guesser, case, tmp_path, capsys):
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
    assert campaign.main([*arguments, "--command", "another"]) == 2
    assert "holds another campaign" in capsys.readouterr().err


def test_command_that_fails_is_a_crash_with_its_last_words(case, tmp_path):
    script = tmp_path / "failing.py"
    script.write_text("import sys; sys.exit('no such thing')")
    row = campaign.ask(case, [sys.executable, str(script)], 30.0)
    assert (row["score"], row["why"]) == ("crash", "exit code 1: no such thing")


def test_command_that_takes_too_long_is_ended(case, tmp_path):
    script = tmp_path / "endless.py"
    script.write_text("while True: pass")
    assert campaign.ask(case, [sys.executable, str(script)], 0.3)["score"] == "timeout"


def test_stopped_campaign_leaves_nothing_running(case, tmp_path):
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
    deadline_s = time.monotonic() + PATIENCE_S
    while not (running.exists() and running.read_text()):
        assert time.monotonic() < deadline_s
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    assert b"the same command goes on from here" in told
    with pytest.raises(ProcessLookupError):
        os.kill(int(running.read_text()), 0)


def test_page_shows_every_answer():
    row = {"case": "case_000", "seed": 1, "kind": "single", "truth": ["impact"], "named": ["wind_gust"], "group": []}
    row |= {
        "verdict": "named",
        "score": "wrong_name",
        "closed_percent": 80.0,
        "seconds": 3.0,
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
