"""`plumbline reconcile` as its users meet it: a recording that brings its rig, Ctrl-C, the same answer twice, bad input."""

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.cli.main import main
from tests.waiting import PATIENCE_S

RIG = """[rope]
length_m = 6.0
[housing]
position_m = 2.5
[sensor]
sample_rate_hz = 25
noise_g = 0.0008
full_scale_g = 2.0
"""
LOG_S = 45
OUTPUTS = {"--json": "out.json", "--report": "out.html", "--prediction": "out.csv", "--write-model": "out.toml"}


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(RIG)
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A gateway's recording of a swing that dies away."""
    folder = tmp_path_factory.mktemp("log")
    (folder / "rig.toml").write_text(RIG)
    path = folder / "log.mcap"
    effect = ["--effect", "viscous_damping:damping_ratio=0.01"]
    assert main(["simulate", str(folder / "rig.toml"), "--out", str(path), *effect, "--duration", f"{LOG_S}"]) == 0
    return path


def outputs(folder: Path) -> list[str]:
    folder.mkdir()
    return [str(word) for name, file in OUTPUTS.items() for word in (name, folder / file)]


@pytest.mark.slow
def test_recording_of_the_gateway_needs_no_other_file_and_gives_the_same_answer_twice(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answers = []
    for name in ("first", "second"):
        assert main(["reconcile", str(log), *outputs(tmp_path / name), "--seed", "4"]) == 0
        answers.append(json.loads((tmp_path / name / "out.json").read_text()))
        answers[-1].pop("runtime_s")
    assert answers[0] == answers[1]
    assert [effect["name"] for effect in answers[0]["effects"]] == ["viscous_damping"]
    for file in ("out.csv", "out.toml"):
        assert (tmp_path / "first" / file).read_bytes() == (tmp_path / "second" / file).read_bytes()
    assert len((tmp_path / "first" / "out.csv").read_text().splitlines()) == LOG_S * 25 + 1
    assert "viscous_damping" in capsys.readouterr().out

    with_it = ["reconcile", str(log), "--rig", str(tmp_path / "first" / "out.toml")]
    assert main(with_it) == 0
    assert "nothing is missing" in capsys.readouterr().out


@pytest.mark.slow
def test_ctrl_c_gives_the_best_answer_so_far(log: Path, tmp_path: Path) -> None:
    written = tmp_path / "written"
    leader, follower = pty.openpty()  # a terminal: the progress bar tells when the search goes on
    command = [sys.executable, "-m", "gateway", "reconcile", str(log), *outputs(written)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=follower)
    os.close(follower)
    told = b""
    while b"search" not in told:
        told += os.read(leader, 4096)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=PATIENCE_S)
    while chunk := _rest(leader):
        told += chunk
    os.close(leader)
    assert process.returncode in (0, 1), told
    assert b"The search was ended early: this is the best answer so far." in out
    answer = json.loads((written / "out.json").read_text())
    assert answer["ended_early"]
    assert {path.name for path in written.iterdir()} >= {"out.json", "out.csv", "out.toml"}


@pytest.mark.slow
def test_a_search_ends_after_the_time_that_it_is_given(log: Path, tmp_path: Path) -> None:
    written = tmp_path / "written"
    assert main(["reconcile", str(log), *outputs(written), "--at-most", "0.001"]) in (0, 1)
    answer = json.loads((written / "out.json").read_text())
    assert answer["ended_early"]
    assert len(answer["ranking"]) == 1
    assert answer["reason"].endswith("this is the best answer so far.")
    assert "no effect of the vocabulary" not in answer["reason"], "most of them were not tried"


def _rest(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # Linux: nobody is at the other end any more
        return b""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ([], "reconcile needs a recording: reconcile LOG --rig RIG; or --plan RIG without one"),
        (["empty.csv", "--rig", "rig.toml"], "empty.csv: is empty"),
        (["empty.mcap"], "empty.mcap: is empty"),
        (["wrong.csv", "--rig", "rig.toml"], "wrong.csv: which columns are the axes? give --columns X,Y,Z"),
        (["log.csv"], "log.csv: says nothing of its rig; give --rig RIG"),
        (
            ["log.csv", "wrong.csv", "--rig", "rig.toml"],
            "log.csv: cannot be joined with other files; only .mcap files of",
        ),
        (["log.csv", "--rig", "no_rope.toml"], "no_rope.toml: rope"),
        (["none.csv", "--rig", "rig.toml"], "none.csv: no such file"),
        (["log.csv", "--rig", "rig.toml", "--held-out", "wrong.csv"], "wrong.csv: which columns are the axes?"),
        (["log.csv", "--rig", "rig.toml", "--held-out", "./log.csv"], "--held-out log.csv: is LOG itself"),
        (["log.csv", "--rig", "rig.toml", "--json", "log.csv"], "--json log.csv: is LOG as well; choose another name"),
        (["log.csv", "--rig", "rig.toml", "--json", "a", "--report", "a"], "--report a: is --json as well"),
    ],
)
def test_bad_input_is_one_line_before_any_work(
    words: list[str],
    fault: str,
    rig: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    header = "time_s,ax_g,ay_g,az_g\n"
    swing = "".join(f"{i / 25},0,0,1\n" for i in range(400))
    files = {"empty.csv": "", "empty.mcap": "", "wrong.csv": "t,a,b\n1,2,3\n", "log.csv": header + swing}
    for name, text in (files | {"no_rope.toml": "[housing]\nposition_m = 1.0\n"}).items():
        Path(name).write_text(text)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(["reconcile", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"plumbline reconcile: {fault}")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("command", [["reconcile", "log.csv"], ["simulate", "rig.toml", "--out", "log.csv"]])
@pytest.mark.parametrize("seed", ["-1", "1.5", "x"])
def test_seed_is_a_whole_number(command: list[str], seed: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--seed", seed])
    assert f"argument --seed: {seed} is not a whole number from 0" in capsys.readouterr().err


@pytest.mark.slow
def test_wrong_rig_is_told_and_reported(
    log: Path, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig.write_text(RIG.replace("6.0", "15.0"))
    assert main(["reconcile", str(log), "--rig", str(rig), *outputs(tmp_path / "wrong")]) == 1
    assert "check rope.length_m (6" in capsys.readouterr().out
    assert json.loads((tmp_path / "wrong" / "out.json").read_text())["verdict"] == "data_unusable"
    assert "check rope.length_m" in (tmp_path / "wrong" / "out.html").read_text()
