"""Many cases with the effect hidden, put to `plumbline reconcile`, scored; goes on where it was stopped.

`python -m tests.blind.campaign --cases 300 --seed 1 --jobs 2 --out results.json [--report results.md]`; with `--folder DIR`
the cases are not made but found there. A case that crashed is asked again, one that ran out of time is not.
"""

import argparse
import json
import multiprocessing
import shlex
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from tests.blind import confusion, kept, score
from tests.blind.asking import ask
from tests.blind.kept import Given
from tests.blind.plan import Plan, plan_cases

Row = dict[str, Any]
PLUMBLINE = "plumbline"
"""Of this checkout, by this Python."""
CANCELLED = 130
MAKING_S = 600.0
"""No case takes longer to make, even beside other work: a worker that is silent for longer was killed."""


@dataclass(frozen=True, slots=True)
class Question:
    """How every case is asked."""

    command: tuple[str, ...]
    timeout_s: float = 150.0
    cases_dir: Path | None = None
    """Where the cases' folders stay; without it they are removed."""


class WorkAmissError(ValueError):
    """Arguments that do not go together."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code 0 done, 1 a worker was killed, 2 bad usage, 130 stopped: what is done is in the file."""
    chosen = _parser().parse_args(arguments)
    question = Question(_command(chosen), chosen.timeout, chosen.cases_dir)
    heading = {"cases": chosen.cases, "seed": chosen.seed, "command": chosen.command}
    try:
        tasks = _tasks(chosen)
        if chosen.folder is not None:
            heading |= {"cases": len(tasks), "seed": None}
        done = _done_before(chosen.out, heading)
    except WorkAmissError as error:
        print(f"campaign: {error}", file=sys.stderr)
        return 2
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    code = 0
    try:
        _ask_all(tasks, done, question, heading, chosen)
    except KeyboardInterrupt:
        print("\ncampaign: stopped; the same command goes on from here", file=sys.stderr)
        code = CANCELLED
    except multiprocessing.TimeoutError:
        print("\ncampaign: a worker is gone; the same command goes on from here", file=sys.stderr)
        code = 1
    page = confusion.markdown(sorted(done, key=lambda row: row["index"]))
    if chosen.report is not None:
        chosen.report.write_text(page)
    print(page)
    return code


def _ask_all(
    tasks: list[Plan | Given], done: list[Row], question: Question, heading: Row, chosen: argparse.Namespace
) -> None:
    """Adds to what is done, in the file, too, case by case."""
    finished = {row["index"] for row in done}
    left = [task for task in tasks if task.index not in finished]
    begun_s = time.monotonic()
    for count, row in enumerate(_rows(left, question, chosen.jobs), start=1):
        done.append(row)
        _save(chosen.out, heading, done)
        _tell(done, len(tasks), (time.monotonic() - begun_s) / count * (len(left) - count))


def case_row(task: Plan | Given, question: Question) -> Row:
    """Make or find one case, ask, score."""
    if isinstance(task, Given):
        return _asked(task.index, task.folder, question)
    place = tempfile.TemporaryDirectory() if question.cases_dir is None else nullcontext(str(question.cases_dir))
    with place as folder:
        return _asked(task.index, kept.make(task, Path(folder)), question)


def _asked(index: int, case: Path, question: Question) -> Row:
    return {"index": index} | kept.facts_of(case) | ask(case, question.command, question.timeout_s)


def _command(chosen: argparse.Namespace) -> tuple[str, ...]:
    return (sys.executable, "-m", "gateway") if chosen.command == PLUMBLINE else tuple(shlex.split(chosen.command))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="script/campaign", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.json", help="results; cases answered in it are not asked again"
    )
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="write the tables there too")
    parser.add_argument(
        "--command", default=PLUMBLINE, help="what is asked: something that takes plumbline's arguments"
    )
    parser.add_argument(
        "--folder", type=Path, metavar="DIR", help="ask the cases in there (case_*) instead of making them"
    )
    parser.add_argument("--timeout", type=float, default=150.0, help="seconds for one case (150)")
    parser.add_argument(
        "--cases-dir", type=Path, metavar="DIR", help="keep the cases that are made there, and use those that it has"
    )
    return parser


def _tasks(chosen: argparse.Namespace) -> list[Plan | Given]:
    """Raises `WorkAmissError` where a folder has no cases, or those of another campaign."""
    if chosen.folder is not None:
        found = sorted(chosen.folder.glob("case_*"))
        if not found:
            raise WorkAmissError(f"--folder {chosen.folder}: there is no case_* in it")
        return [Given(index, folder) for index, folder in enumerate(found)]
    plans = plan_cases(chosen.cases, chosen.seed)
    if chosen.cases_dir is not None:
        others = kept.of_others(plans, chosen.cases_dir)
        if others:
            raise WorkAmissError(f"--cases-dir {chosen.cases_dir} holds another campaign's {others[0]}; give another")
    return list(plans)


def _rows(tasks: list[Plan | Given], question: Question, jobs: int) -> Iterator[Row]:
    """Rows as they come, from processes of their own: MuJoCo's callbacks belong to the whole process."""
    work: Callable[[Plan | Given], Row] = partial(case_row, question=question)
    with multiprocessing.get_context("spawn").Pool(jobs, initializer=_leave_quietly) as pool:
        rows = pool.imap_unordered(work, tasks)
        for _ in tasks:
            yield rows.next(timeout=question.timeout_s + MAKING_S)


def _leave_quietly() -> None:
    """A stopped worker ends what it asked and says nothing."""
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, _exit)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(CANCELLED)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _done_before(out: Path, heading: dict[str, Any]) -> list[Row]:
    """Rows of an earlier run of the same campaign; without those that crashed, which are asked again."""
    if not out.exists():
        return []
    earlier = json.loads(out.read_text())
    found = {key: earlier.get(key) for key in heading}
    if found != heading:
        raise WorkAmissError(f"{out} holds another campaign ({found}); give another --out")
    return [row for row in earlier["rows"] if row["score"] != score.CRASH]


def _save(out: Path, heading: dict[str, Any], rows: list[Row]) -> None:
    """One line for each row."""
    ordered = sorted(rows, key=lambda row: row["index"])
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in heading.items()]
    lines.append(f'"summary": {json.dumps(score.summary(rows))}')
    listed = ",\n".join(json.dumps(row) for row in ordered)
    beside = out.with_suffix(".part")
    beside.write_text("{" + ",\n".join(lines) + f',\n"rows": [\n{listed}\n]}}\n')
    beside.replace(out)


def _tell(rows: list[Row], total: int, left_s: float) -> None:
    figures, last = score.summary(rows), rows[-1]
    line = f"{len(rows)}/{total} ({left_s / 60:.0f} min left) right {figures['right_percent']:.1f} % "
    line += f"wrong names {figures['confident_wrong_percent']:.1f} % false alarms {figures['false_alarms']}/{figures['nulls']}"
    line += f" | {last['case']} {last['score']}: {confusion.truth_of(last)} -> {confusion.said_of(last)} {last['seconds']:.0f} s"
    end = "\r" if sys.stderr.isatty() else "\n"
    print(f"\x1b[K{line[:150]}" if sys.stderr.isatty() else line, end=end, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
