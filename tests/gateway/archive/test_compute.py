"""Commands of one machine over an archive: each task answers once, and what breaks, breaks alone."""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.archive.compute import ComputeResult, Workers, compute
from gateway.archive.rows import RECORDINGS
from gateway.archive.tables import Archive
from gateway.archive.tasks import Task, TaskKind, TaskLimits, plan_tasks
from gateway.cli.main import main
from gateway.errors import ANSWER_IS_NO, BAD_INPUT
from tests.gateway.archive.small_recordings import SmallCrane, indexed, select
from tests.gateway.recorded_crane import RecordedCrane
from tests.ports import unused_port
from tests.waiting import PATIENCE_S, wait_until

LIMITS = TaskLimits(time_s=PATIENCE_S, attempts=2)


@pytest.fixture
def table(clean: Path, tmp_path: Path) -> Path:
    """The archive of three cranes, to be added to."""
    return shutil.copytree(clean, tmp_path / "table")


@pytest.fixture
def one(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> Path:
    """The archive of one of them."""
    indexed(fleet[0].folder, tmp_path / "one", keys)
    return tmp_path / "one"


def run(
    source: Path, table: Path, kind: TaskKind, limits: TaskLimits = LIMITS, *, again: bool = False
) -> ComputeResult:
    return compute(Archive(str(table)), str(source), kind, Workers(2), limits, again=again)


def states(table: Path) -> list[tuple[str, str, int]]:
    return [
        (state, verdict, attempts)
        for state, verdict, attempts in select(
            table, "SELECT state, verdict, attempts FROM results ORDER BY crane, utc"
        )
    ]


@pytest.mark.slow
def test_tasks_are_gateways_starts_and_recordings(fleet: list[SmallCrane], table: Path) -> None:
    files = Archive(str(table)).files(Archive(str(table)).open(RECORDINGS))
    assert [len(task.files) for task in plan_tasks("verify", files)] == [3, 3, 3]
    assert [len(task.files) for task in plan_tasks("measure", files)] == [1] * 9
    paths = [file.row.path for file in plan_tasks("replay", files)[0].files]
    assert paths == [f"crane-1/{path.name}" for path in fleet[0].files]


@pytest.mark.slow
def test_the_answers_are_those_of_the_commands(
    recorded: RecordedCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, table = tmp_path / "source", tmp_path / "table"
    source.mkdir()
    path = shutil.copy(recorded.files[0], source)
    indexed(source, table)
    assert run(source, table, "replay").verdicts == {"equal": 1}
    assert run(source, table, "measure").failed == []
    ((content,),) = select(table, "SELECT content FROM results WHERE kind = 'measure'")
    assert main(["measure", str(path), "--json", "-"]) == 0
    assert _to_nine_digits(content) == _to_nine_digits(capsys.readouterr().out)


def _to_nine_digits(answer: str) -> object:
    """Read an answer; the last digits of a fit depend on where its arrays lie in memory."""
    return json.loads(answer, parse_float=lambda text: f"{float(text):.9g}")


@pytest.mark.slow
def test_what_has_an_answer_is_not_done_again(fleet: list[SmallCrane], table: Path) -> None:
    source = fleet[0].folder.parent
    first = run(source, table, "verify")
    assert (first.planned, first.known, first.verdicts) == (3, 0, {"genuine": 3})
    second = run(source, table, "verify")
    assert (second.planned, second.known, second.verdicts) == (3, 3, {})
    assert states(table) == [("done", "genuine", 1)] * 3


@pytest.mark.slow
def test_a_recording_that_does_not_suit_is_told_once_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, table = tmp_path / "source", tmp_path / "table"
    SmallCrane(source, segments=1).record()
    indexed(source, table)
    arguments = ["archive", "measure", str(source), "--table", str(table), "--processes", "2"]
    assert main(arguments) == ANSWER_IS_NO
    printed = capsys.readouterr().out
    assert "refused: plumbline measure:" in printed
    assert "has no samples" in printed
    assert "1 tasks, 0 had an answer: 1 refused" in printed
    assert states(table) == [("refused", "", 1)]
    assert main(arguments) == 0
    assert "1 tasks, 1 had an answer: nothing to do" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (TaskLimits(time_s=0.05, attempts=2), "took longer than 0.05 s"),
        (TaskLimits(time_s=PATIENCE_S, memory_mb=100, attempts=2), "ended with code"),
    ],
)
def test_a_task_that_takes_too_much_is_poison_after_its_attempts(
    limits: TaskLimits, reason: str, fleet: list[SmallCrane], one: Path
) -> None:
    ((_, outcome),) = run(fleet[0].folder, one, "verify", limits).failed
    assert (outcome.state, outcome.attempts) == ("poison", 2)
    assert reason in outcome.reason
    assert run(fleet[0].folder, one, "verify").known == 1
    assert run(fleet[0].folder, one, "verify", again=True).verdicts == {"genuine": 1}
    assert states(one) == [("done", "genuine", 1)]


@pytest.mark.slow
def test_a_vanished_file_fails_alone(fleet: list[SmallCrane], keys: Path, tmp_path: Path) -> None:
    source = tmp_path / "source"
    for number, crane in enumerate(fleet[:2]):
        (source / str(number)).mkdir(parents=True)
        for path in crane.files:
            (source / str(number) / path.name).write_bytes(path.read_bytes())
    indexed(source, tmp_path / "table", keys)
    next((source / "0").glob("*.mcap")).unlink()
    found = run(source, tmp_path / "table", "verify")
    assert found.verdicts == {"genuine": 1, "refused": 1}
    assert "no such file" in found.failed[0][1].reason.lower()


@pytest.mark.slow
def test_an_interrupted_run_ends_its_tasks_and_the_next_one_goes_on(fleet: list[SmallCrane], table: Path) -> None:
    source = fleet[0].folder.parent
    command = [sys.executable, "-m", "gateway", "archive", "verify", source, "--table", table, "--processes", "1"]
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: _has_child(process.pid), "the first task")
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, said
    before = len(states(table))
    assert before < 3
    assert states(table) == [("done", "genuine", 1)] * before  # nothing that was ended has an answer
    assert run(source, table, "verify").known == before
    assert states(table) == [("done", "genuine", 1)] * 3


def _has_child(pid: int) -> bool:
    return any(path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children"))


@pytest.mark.slow
def test_a_cluster_gives_the_same_answers_although_a_worker_dies(fleet: list[SmallCrane], table: Path) -> None:
    """A scheduler and two workers, real processes; one worker is killed in the middle."""
    address = f"tcp://127.0.0.1:{unused_port()}"
    programs = [[*_dask("scheduler"), "--host", address, "--no-dashboard"]]
    programs += [[*_dask("worker"), address, "--nthreads", "1", "--no-dashboard", "--no-nanny"] for _ in range(2)]
    processes = [subprocess.Popen(each, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for each in programs]
    source = fleet[0].folder.parent
    command = [sys.executable, "-m", "gateway", "archive", "verify", source, "--table", table, "--cluster", address]
    try:
        running = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        wait_until(lambda: _has_child(processes[1].pid) or running.poll() is not None, "the first task of a worker")
        processes[1].kill()
        said, _ = running.communicate(timeout=PATIENCE_S)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert running.returncode == 0, said
    assert [row[:2] for row in states(table)] == [("done", "genuine")] * 3


def _dask(part: str) -> list[str]:
    return [sys.executable, "-m", "distributed.cli.dask_" + part]


@pytest.mark.slow
def test_a_cluster_that_is_not_there_is_one_line(
    fleet: list[SmallCrane], table: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gateway.archive.compute.CONNECT_S", 1)
    address = f"tcp://127.0.0.1:{unused_port()}"
    arguments = ["archive", "verify", str(fleet[0].folder.parent), "--table", str(table), "--cluster", address]
    assert main(arguments) == BAD_INPUT
    assert f"--cluster {address}: no scheduler answers" in capsys.readouterr().err


def test_a_mistyped_place_of_the_tables_is_refused_and_not_made(
    fleet: list[SmallCrane], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["archive", "replay", str(fleet[0].folder), "--table", str(tmp_path / "none")]) == BAD_INPUT
    assert "none: has no table recordings; make it with plumbline archive index" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("content", "verdict"),
    [
        ({"equal": True, "is_compared": True}, "equal"),
        ({"equal": False, "is_compared": True}, "differs"),
        ({"equal": False, "is_compared": False}, "not_compared"),
        ({"equal": True}, "equal"),
    ],
)
def test_a_replay_that_compared_nothing_is_neither_equal_nor_different(content: dict[str, bool], verdict: str) -> None:
    assert Task("replay", (), None).verdict(content) == verdict
