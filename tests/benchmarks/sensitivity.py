"""Which tuned numbers matter: move each by 30 % up and down, one at a time, and compare what is then answered.

`script/sensitivity SUBJECT [--only MODULE] [--jobs N]` with the subjects swing, conditions and reconcile. Every version runs in a
process of its own on a small fixed set of recordings. Results are kept in `tests/benchmarks/results/sensitivity.json`; a run that
was stopped goes on where it was, and `--fresh` begins anew. `docs/tuned_numbers.md` is made of them by `script/docs`.

A number matters where a case is answered otherwise (an angle, an interval, a verdict, a name; whether the interval holds the
truth), or where in a case the interval's width changes by more than 10 %, or the angle by more than 10 % of that width.
CPU time counts from a change by half on.
"""

import argparse
import json
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.sensitivity_cases import SUBJECTS, Outcome
from tests.benchmarks.tuned_numbers import TunedNumber, find_tuned_numbers, move_on_import

RESULTS = Path(__file__).parent / "results" / "sensitivity.json"
FACTORS = {"down": 0.7, "up": 1.3}
UNCHANGED = 1e-6
MATTERS = 0.1
TINY = 1e-12
SLOWER = 1.5
Task = tuple[str, TunedNumber | None, float, float]
Outcomes = dict[str, Any]
"""Outcome of each case, and the CPU time of all under "cpu_s"; or why there is none under "error"."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is not measured yet; exit code 0."""
    chosen = _parser().parse_args(arguments)
    subject = SUBJECTS[chosen.subject]
    numbers = find_tuned_numbers(chosen.only or subject.packages)
    kept = {} if chosen.fresh or not RESULTS.exists() else json.loads(RESULTS.read_text())
    found = kept.setdefault(chosen.subject, {"base": {}, "numbers": {}})
    subject.cases()  # makes the recordings once, for all processes
    found["base"] = found["base"] or _in_own_process((chosen.subject, None, 1.0, 0.0))
    tasks = list(_tasks(chosen.subject, numbers, found))
    with multiprocessing.get_context("fork").Pool(chosen.jobs, maxtasksperchild=1) as pool:
        began_s = time.monotonic()
        for done, (label, value, direction, effect) in enumerate(pool.imap_unordered(_measured, tasks), 1):
            entry = found["numbers"].setdefault(label, {})
            if entry.get("value") != value:
                entry.clear()
            entry |= {"value": value, direction: effect}
            _write(kept)
            left_s = (time.monotonic() - began_s) / done * (len(tasks) - done)
            print(
                f"\r{done} of {len(tasks)}, {left_s / 60:.0f} min left  {label} {effect}"[:150].ljust(150),
                end="",
                file=sys.stderr,
            )
    print(file=sys.stderr)
    for number in numbers:
        entry = found["numbers"].get(number.label, {})
        print(f"{number.label:75} {number.value:10.6g}  -30 %: {entry.get('down', '')}; +30 %: {entry.get('up', '')}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("subject", choices=list(SUBJECTS))
    parser.add_argument("--only", action="append", metavar="MODULE", help="numbers of this module or package alone")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--fresh", action="store_true", help="forget what was measured before")
    return parser


def _tasks(subject: str, numbers: Sequence[TunedNumber], found: dict[str, Any]) -> Iterator[tuple[Any, ...]]:
    for number in numbers:
        entry = found["numbers"].get(number.label, {})
        for direction, factor in FACTORS.items():
            if entry.get("value") != number.value or direction not in entry:
                yield subject, number, direction, factor, found["base"]


def _measured(task: tuple[Any, ...]) -> tuple[str, float, str, str]:
    subject, number, direction, factor, base = task
    limit_s = 10 * base["cpu_s"] + 10
    return number.label, number.value, direction, effect_of(base, _outcomes((subject, number, factor, limit_s)))


def _in_own_process(task: Task) -> Outcomes:
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.apply(_outcomes, (task,))


def _outcomes(task: Task) -> Outcomes:
    subject, number, factor, limit_s = task
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    signal.signal(signal.SIGPROF, _out_of_time)
    if number is not None:
        move_on_import(number, factor)
    judge = SUBJECTS[subject].judge
    found: Outcomes = {}
    try:
        judge(SUBJECTS[subject].cases()[0])  # imports are not to be counted as time
        began_s = time.process_time()
        for case in SUBJECTS[subject].cases():
            found[case] = judge(case)
        found["cpu_s"] = time.process_time() - began_s
    except Exception as error:  # noqa: BLE001  # whatever a moved number breaks is a result
        return {"error": type(error).__name__}
    return found


def _out_of_time(_signal: int, _frame: Any) -> None:
    raise TimeoutError


def effect_of(base: Outcomes, moved: Outcomes) -> str:
    """Return in a few words what a moved number changes."""
    if "error" in moved:
        return f"fails ({moved['error']})"
    cases = [case for case in base if case != "cpu_s"]
    other = [case for case in cases if base[case]["states"] != moved[case]["states"]]
    answers = sum(sum(base[case]["states"].values()) for case in cases)
    changed = sum(_changed(base[case]["states"], moved[case]["states"]) for case in cases)
    said = [f"{changed} of {answers} answers in {len(other)} cases"] if other else []
    same = [case for case in cases if case not in other]
    widths = {case: _rms(moved[case]["widths_deg"]) / max(_rms(base[case]["widths_deg"]), TINY) for case in same}
    shifts = {case: _shift(base[case], moved[case]) for case in same}
    widest = max(widths, key=lambda case: abs(np.log(max(widths[case], TINY))) if widths[case] else 0.0, default=None)
    farthest = max(shifts, key=lambda case: shifts[case], default=None)
    if widest is not None and widths[widest] and abs(widths[widest] - 1) > MATTERS:
        said.append(f"interval {100 * (widths[widest] - 1):+.0f} % ({widest})")
    if farthest is not None and shifts[farthest] > MATTERS:
        said.append(f"angle by {100 * shifts[farthest]:.0f} % of its interval ({farthest})")
    slower = moved["cpu_s"] / base["cpu_s"]
    if not 1 / SLOWER < slower < SLOWER:
        said.append(f"time x {slower:.1f}")
    if said:
        return ", ".join(said)
    return "slight" if any(_differ(base[case], moved[case]) for case in cases) else "none"


def _changed(one: dict[str, int], other: dict[str, int]) -> int:
    """Return how many answers differ between two counts of answers."""
    names = {*one, *other}
    gone = sum(max(one.get(name, 0) - other.get(name, 0), 0) for name in names)
    come = sum(max(other.get(name, 0) - one.get(name, 0), 0) for name in names)
    return max(gone, come)


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0


def _shift(one: Outcome, other: Outcome) -> float:
    """Return the rms by which the angles of a case change, over its interval."""
    moved_by = np.subtract(one["errors_deg"], other["errors_deg"])
    return _rms(moved_by.tolist()) / max(_rms(one["widths_deg"]), TINY) if one["widths_deg"] else 0.0


def _differ(one: Outcome, other: Outcome) -> bool:
    return any(
        not np.allclose(one[name], other[name], rtol=1e-4, atol=UNCHANGED) for name in ("errors_deg", "widths_deg")
    )


def _write(kept: dict[str, Any]) -> None:
    RESULTS.parent.mkdir(exist_ok=True)
    partial = RESULTS.with_suffix(".partial")
    partial.write_text(json.dumps(kept, indent=1, sort_keys=True) + "\n")
    partial.replace(RESULTS)


if __name__ == "__main__":
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.exit(main())
