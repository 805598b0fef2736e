"""Many cases with the effect hidden, put to `plumbline reconcile`, scored; goes on where it was stopped.

`python -m tests.blind.campaign --cases 300 --seed 1 --jobs 2 --out results.json [--report results.md]`; with `--folder DIR`
the cases are not made but found there.
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

from tests.blind import confusion, score
from tests.blind.asking import ask
from tests.blind.cases import generate
from tests.blind.plan import CATALOGUE, Plan, plan_cases
from tests.blind.write import write_case

Row = dict[str, Any]
PLUMBLINE = "plumbline"
"""Of this checkout, by this Python."""
CANCELLED = 130


@dataclass(frozen=True, slots=True)
class Question:
    """How every case is asked."""

    command: tuple[str, ...]
    timeout_s: float = 120.0
    keep: Path | None = None
    """Where the cases' folders stay; without it they are removed."""


@dataclass(frozen=True, slots=True)
class Found:
    """A case that is there already."""

    index: int
    folder: Path


class WorkAmissError(ValueError):
    """Arguments that do not go together."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code 0 done, 2 bad usage, 130 stopped: what is done is in the file."""
    chosen = _parser().parse_args(arguments)
    asked = (sys.executable, "-m", "gateway") if chosen.command == PLUMBLINE else tuple(shlex.split(chosen.command))
    question = Question(asked, chosen.timeout, chosen.keep)
    tasks = _tasks(chosen)
    heading = {"cases": len(tasks), "seed": None if chosen.folder else chosen.seed, "command": chosen.command}
    try:
        done = _done_before(chosen.out, heading)
    except WorkAmissError as error:
        print(f"campaign: {error}", file=sys.stderr)
        return 2
    finished = {row["index"] for row in done}
    left = [task for task in tasks if task.index not in finished]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    code = 0
    try:
        for row in _rows(left, question, chosen.jobs):
            done.append(row)
            _save(chosen.out, heading, done)
            _tell(done, len(tasks))
    except KeyboardInterrupt:
        print("\ncampaign: stopped; the same command goes on from here", file=sys.stderr)
        code = CANCELLED
    page = confusion.markdown(sorted(done, key=lambda row: row["index"]))
    if chosen.report is not None:
        chosen.report.write_text(page)
    print(page)
    return code


def case_row(task: Plan | Found, question: Question) -> Row:
    """Make or find one case, ask, score."""
    return _found_row(task, question) if isinstance(task, Found) else _made_row(task, question)


def _made_row(plan: Plan, question: Question) -> Row:
    place = tempfile.TemporaryDirectory() if question.keep is None else nullcontext(str(question.keep))
    with place as folder:
        path = Path(folder, f"case_{plan.index:03d}")
        begun_s = time.monotonic()
        case = generate(plan)
        write_case(case, path)
        made_s = time.monotonic() - begun_s
        row = ask(path, question.command, question.timeout_s)
    facts = {"kind": plan.kind, "coloured": plan.coloured, "jittered": plan.jittered, "small": plan.small}
    facts |= {"excess": case.truth["excess_alone"], "noise_g": case.rig.noise_g, "made_s": round(made_s, 2)}
    return {"index": plan.index, "seed": plan.seed} | facts | row


def _found_row(found: Found, question: Question) -> Row:
    truth = json.loads((found.folder / "truth.json").read_text())
    names = truth["effects"].keys()
    kind = "outside" if names - CATALOGUE.keys() else ("null", "single", "pair")[min(len(names), 2)]
    plain = {"coloured": False, "jittered": False, "small": False, "excess": {}}
    facts = {"index": found.index, "seed": truth.get("seed"), "kind": kind} | plain
    return facts | ask(found.folder, question.command, question.timeout_s)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="script/campaign", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.json", help="results; cases found in it are not run again"
    )
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="write the tables there too")
    parser.add_argument(
        "--command", default=PLUMBLINE, help="what is asked: something that takes plumbline's arguments"
    )
    parser.add_argument(
        "--folder", type=Path, metavar="DIR", help="ask the cases in there (case_*) instead of making them"
    )
    parser.add_argument("--timeout", type=float, default=120.0, help="seconds for one case")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the cases' files there")
    return parser


def _tasks(chosen: argparse.Namespace) -> list[Plan | Found]:
    if chosen.folder is None:
        return list(plan_cases(chosen.cases, chosen.seed))
    return [Found(index, folder) for index, folder in enumerate(sorted(chosen.folder.glob("case_*")))]


def _rows(tasks: list[Plan | Found], question: Question, jobs: int) -> Iterator[Row]:
    """Rows as they come, from processes of their own: MuJoCo's callbacks belong to the whole process."""
    work: Callable[[Plan | Found], Row] = partial(case_row, question=question)
    with multiprocessing.get_context("spawn").Pool(jobs, initializer=_leave_quietly) as pool:
        yield from pool.imap_unordered(work, tasks)


def _leave_quietly() -> None:
    """A stopped worker ends what it asked and says nothing."""
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, _exit)


def _exit(_number: int, _frame: FrameType | None) -> None:
    sys.exit(CANCELLED)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _done_before(out: Path, heading: dict[str, Any]) -> list[Row]:
    """Rows of an earlier run of the same campaign."""
    if not out.exists():
        return []
    earlier = json.loads(out.read_text())
    found = {key: earlier.get(key) for key in heading}
    if found != heading:
        raise WorkAmissError(f"{out} holds another campaign ({found}); give another --out")
    return list(earlier["rows"])


def _save(out: Path, heading: dict[str, Any], rows: list[Row]) -> None:
    beside = out.with_suffix(".part")
    ordered = sorted(rows, key=lambda row: row["index"])
    beside.write_text(json.dumps(heading | {"summary": score.summary(rows), "rows": ordered}, indent=1))
    beside.replace(out)


def _tell(rows: list[Row], total: int) -> None:
    figures, last = score.summary(rows), rows[-1]
    line = f"{len(rows)}/{total} right {figures['right_percent']:.1f} % wrong names {figures['confident_wrong_percent']:.1f} % "
    line += f"false alarms {figures['false_alarms']}/{figures['nulls']} | {last['case']} {last['score']}: "
    line += f"{confusion.truth_of(last)} -> {confusion.said_of(last)} {last['seconds']:.0f} s"
    end = "\r" if sys.stderr.isatty() else "\n"
    print(f"\x1b[K{line[:150]}" if sys.stderr.isatty() else line, end=end, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
