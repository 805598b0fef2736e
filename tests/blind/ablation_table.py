"""What each part of `reconcile` buys: every part is taken away on the cases on which it does something.

`script/ablate --cases 170 --seed 1 --cases-dir CASES [FOLDER ...] --out results.json [--report FILE.md] [--only PART]`: cases are
made in CASES; each FOLDER holds further ones (case_*) with their truth. A part that has won `ENOUGH_WON` cases stays, and is
asked no further. Stop it at will: it goes on later.
"""

import argparse
import hashlib
import json
import multiprocessing
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.blind import kept
from tests.blind.ablations import PARTS
from tests.blind.asking import ask
from tests.blind.plan import Plan, plan_cases
from tests.blind.score import CONFIDENT_WRONG, CRASH, RIGHT, RIGHT_GROUP, TIMEOUT

Row = dict[str, Any]
ENOUGH_WON = 4
"""Cases lost without a part from which on it is certain to stay: four times what one of 200 asks for."""
BATCH = 4
"""Cases between two looks at what a part has lost."""
ANSWER = ("verdict", "named", "group", "score")
FALSE_ALARM = "false_alarm"


@dataclass(frozen=True, slots=True)
class Worth:
    """What a part buys on the cases of a campaign."""

    asked: int
    """Cases on which the part did something and that were asked without it."""
    left: int
    """Further ones, not asked because the part had shown its worth."""
    changed: int
    """Of those asked, with another answer."""
    won: int
    """Right with the part, not without it."""
    wrong_prevented: int
    """A wrong name or a false alarm without it, none with it."""
    lost: int
    """Right without the part, not with it."""
    wrong_caused: int
    cpu_ratio: float
    """CPU time of those asked, with the part over without it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask what is not asked yet; exit code 0, 2 no cases, 130 stopped."""
    chosen = _parser().parse_args(arguments)
    folders = list(chosen.folders)
    if chosen.cases:
        _make(plan_cases(chosen.cases, chosen.seed), chosen.cases_dir, chosen.jobs)
        folders.append(chosen.cases_dir)
    cases = {_label(case): case for folder in folders for case in sorted(folder.glob("case_*"))}
    if not cases:
        print("ablate: no case_* to ask; give --cases N, or a FOLDER that has some", file=sys.stderr)
        return 2
    kept: dict[str, Any] = json.loads(chosen.out.read_text()) if chosen.out.exists() else {}
    base: dict[str, Row] = kept.setdefault("base", {})
    without: dict[str, dict[str, Row]] = kept.setdefault("without", {})
    try:
        with ThreadPoolExecutor(chosen.jobs) as pool:
            for label, row in _asked(pool, [(label, cases[label], None) for label in cases if label not in base]):
                base[label] = row
                _save(chosen.out, kept)
            for part in chosen.only or PARTS:
                _ask_without(pool, part, cases, base, without.setdefault(part, {}), lambda: _save(chosen.out, kept))
                print(f"\n{part}: {worth_of(part, base, without[part])}")
    except KeyboardInterrupt:
        print("\nablate: stopped; the same command goes on from here", file=sys.stderr)
        return 130
    if chosen.report is not None:
        chosen.report.write_text(markdown(base, without))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="script/ablate", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="given cases: case_*/log.csv, ...")
    parser.add_argument("--cases", type=int, default=0, help="cases to make")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--cases-dir", type=Path, default=Path("ablation_cases"), metavar="DIR", help="where they are made"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.json", help="what is in it is not asked again")
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="write the table there")
    parser.add_argument("--only", action="append", choices=PARTS, metavar="PART", help="these parts alone")
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    return parser


def _make(plans: Sequence[Plan], folder: Path, jobs: int) -> None:
    """Make the cases that the folder does not have, in processes of their own: MuJoCo's callbacks belong to a whole process."""
    folder.mkdir(parents=True, exist_ok=True)
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        for done, _ in enumerate(pool.imap_unordered(partial(kept.make, folder=folder), plans), 1):
            print(f"\rcases: {done} of {len(plans)} made", end="", file=sys.stderr)


def _label(case: Path) -> str:
    return f"{case.parent.name}/{case.name}"


def _ask_without(
    pool: ThreadPoolExecutor,
    part: str,
    cases: Mapping[str, Path],
    base: Mapping[str, Row],
    found: dict[str, Row],
    save: Callable[[], None],
) -> None:
    """Ask the cases on which a part acts, a few at a time, until it has shown its worth."""
    left = [label for label in _shuffled(cases, part) if part in base[label]["acted"] and label not in found]
    while left:
        worth = worth_of(part, base, found)
        if worth.won + worth.wrong_prevented >= ENOUGH_WON:
            break
        batch, left = left[:BATCH], left[BATCH:]
        found.update(_asked(pool, [(label, cases[label], part) for label in batch]))
        save()


def _shuffled(labels: Iterable[str], part: str) -> list[str]:
    seed = hashlib.sha256(part.encode()).digest()
    return random.Random(seed).sample(sorted(labels), k=len(list(labels)))


def _asked(pool: ThreadPoolExecutor, tasks: Sequence[tuple[str, Path, str | None]]) -> Iterable[tuple[str, Row]]:
    began_s = time.monotonic()
    for done, found in enumerate(pool.map(lambda task: (task[0], _ask(task[1], task[2])), tasks), 1):
        left_s = (time.monotonic() - began_s) / done * (len(tasks) - done)
        print(
            f"\r{tasks[0][2] or 'all parts'}: {done} of {len(tasks)}, {left_s / 60:.0f} min left ",
            end="",
            file=sys.stderr,
        )
        yield found


def _ask(case: Path, part: str | None) -> Row:
    """Ask one case without a part, or with all and which of them acted."""
    with tempfile.TemporaryDirectory() as folder:
        acted = Path(folder, "acted.json")
        how = ["--acted", str(acted)] if part is None else ["--without", part]
        row = ask(case, [sys.executable, "-m", "tests.blind.ablations", *how], 200.0, ["--jobs", "1"])
        return row | {"acted": json.loads(acted.read_text()) if acted.exists() else []}


def worth_of(part: str, base: Mapping[str, Row], without: Mapping[str, Row]) -> Worth:
    """Compare the answers with and without a part."""
    counts: Counter[str] = Counter()
    cpu_s = [0.0, 0.0]
    for label, row in without.items():
        before = base[label]
        counts["changed"] += any(row[key] != before[key] for key in ANSWER)
        right, right_without = (each["score"] in (RIGHT, RIGHT_GROUP) for each in (before, row))
        counts["won"] += right and not right_without
        counts["lost"] += right_without and not right
        wrong, wrong_without = (each["score"] in (*CONFIDENT_WRONG, FALSE_ALARM) for each in (before, row))
        counts["prevented"] += wrong_without and not wrong
        counts["caused"] += wrong and not wrong_without
        if not {before["score"], row["score"]} & {CRASH, TIMEOUT}:
            cpu_s[0] += before["cpu_s"]
            cpu_s[1] += row["cpu_s"]
    acted = sum(part in row["acted"] for row in base.values())
    return Worth(
        asked=len(without),
        left=acted - len(without),
        changed=counts["changed"],
        won=counts["won"],
        wrong_prevented=counts["prevented"],
        lost=counts["lost"],
        wrong_caused=counts["caused"],
        cpu_ratio=cpu_s[0] / cpu_s[1] if cpu_s[1] else 1.0,
    )


def markdown(base: Mapping[str, Row], without: Mapping[str, Mapping[str, Row]]) -> str:
    """Return the table, the parts in their order."""
    scores = Counter(row["score"] for row in base.values())
    right = scores[RIGHT] + scores[RIGHT_GROUP]
    wrong = sum(scores[each] for each in (*CONFIDENT_WRONG, FALSE_ALARM))
    lines = [
        f"{len(base)} cases: {right} right, {wrong} with a wrong name or a false alarm.",
        "",
        "| part | what it does | asked | changed | won | wrong prevented | lost | wrong caused | CPU with / without |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for part, rows in without.items():
        worth = worth_of(part, base, rows)
        asked = f"{worth.asked}" if not worth.left else f"{worth.asked} of {worth.asked + worth.left}"
        figures = (asked, worth.changed, worth.won, worth.wrong_prevented, worth.lost, worth.wrong_caused)
        does = PARTS[part].does if part in PARTS else "gone"
        lines.append(f"| {part} | {does} | {' | '.join(map(str, figures))} | {worth.cpu_ratio:.2f} |")
    return "\n".join(lines) + "\n"


def _save(out: Path, kept: Mapping[str, Any]) -> None:
    beside = out.with_suffix(".part")
    beside.write_text(json.dumps(kept, indent=0))
    beside.replace(out)


if __name__ == "__main__":
    sys.exit(main())
