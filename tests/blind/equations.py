"""Campaign of equations: is what the catalogue does not hold described by the right term, and is none invented?

`python -m tests.blind.equations --out equations.json --report equations.md` seeks the law of every case beside the nominal
model; with `--command` each case is put to `plumbline reconcile`, search and verdict included, which takes ten times as long.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.terms import TERMS, registered_library
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.observations import make_observations, split_recordings
from gateway.twin.reconcile.equation import FoundLaw, find_law
from gateway.twin.reconcile.output.result import Gap
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, make_context
from gateway.twin.reconcile.search.validation import Validator
from tests.blind.cases import Case, generate
from tests.blind.plan import CATALOGUE, Plan
from tests.blind.write import write_case

RIGHT_TERMS = {
    "negative_drag": ("force_by_velocity",),
    "backlash": ("backlash",),
    "periodic_wind": ("periodic_force",),
    "pivot_vibration": ("pivot_sway",),
    "driven_torsion": ("periodic_rotation", "housing_torsion"),
    "offset_creep": ("creeping_offset",),
}
"""What describes each hidden law: terms, or an effect of the catalogue that has come to hold it."""
KNOWN = (
    "viscous_damping",
    "quadratic_drag",
    "coulomb_friction",
    "axis_offset",
    "rope_length",
    "steady_wind",
    "housing_position",
)
"""Effects of the catalogue that terms could imitate."""
PER_KIND, NULLS = 8, 20
LENGTHS_S = {"log": 60.0, "held_out": 48.0}
SMALL_SHARE, COLOURED_SHARE = 0.2, 0.5
RIGHT, WRONG, NOTHING, INVENTED, NONE = "right", "wrong term", "no term", "invented", "none"
Row = dict[str, Any]


def plan_laws(seed: int) -> list[Plan]:
    """Return the cases: each hidden law equally often, nulls, and known effects; kinds alternate, so that a part says as much."""
    rng = np.random.default_rng(seed)
    hidden: list[tuple[str, ...]] = []
    for i in range(PER_KIND):
        hidden += [(name,) for name in RIGHT_TERMS]
        hidden += [()] * (NULLS * (i + 1) // PER_KIND - NULLS * i // PER_KIND)
        hidden += [(KNOWN[i],)] if i < len(KNOWN) else []
    plans = []
    for index, names in enumerate(hidden):
        small, coloured = rng.random(2) < [SMALL_SHARE if names else 0.0, 0.0 if names else COLOURED_SHARE]
        kind = "null" if not names else "single" if names[0] in KNOWN else "outside"
        plans.append(Plan(index, int(rng.integers(2**31)), kind, names, bool(coloured), small=bool(small)))
    return plans


def ask(plan: Plan) -> Row:
    """Make a case and seek a law beside what is known of it: the nominal model, and the catalogue's effect if it hides one."""
    case = generate(plan, LENGTHS_S)
    begun_s = time.process_time()
    law, percent = find_law_of(case, plan.hidden if plan.kind == "single" else ())
    terms = () if law is None else law.terms
    text = "" if law is None else "; ".join(_told(law, name) for name in law.terms)
    row = _row(plan, case)
    row |= {"verdict": "", "named": [], "terms": list(terms), "equation": text, "closed_test_percent": percent}
    row |= {"alternatives": [] if law is None else [other for each in law.alternatives.values() for other in each]}
    return row | {"cpu_s": round(time.process_time() - begun_s, 1), "score": score(row["hidden"], [], row["terms"])}


def find_law_of(case: Case, known: Collection[str] = ()) -> tuple[FoundLaw | None, float | None]:
    """Return the law of a case beside the nominal model with known effects, and the share of the test gap that it closes."""
    noise_g = (case.rig.noise_g,) * 3
    rig = TwinRig(case.rig.length_m, case.rig.position_m, noise_g=noise_g, sample_rate_hz=case.rig.rate_hz)
    log, held_out = (
        make_observations(each.time_s, each.force_g, each.temperature_c, np.array(noise_g))
        for each in (case.recordings["log"], case.recordings["held_out"])
    )
    recordings = split_recordings(log, held_out, rig.small_swing_period_s)
    context = make_context(Model(rig, {}), recordings.log, Budget(), lambda: None)
    guess = {name: EFFECTS[name].default_guess for name in known}
    base = context.fit(CandidateTable(recordings.log), guess).fits[frozenset(known)]
    with registered_library():
        law = find_law(context, base, Validator(rig, {}, recordings.selection), np.random.default_rng(0))
    if law is None:
        return None, None
    before, after = (recordings.test.reduced_chi2(each.fit.force_g) for each in (law.before, law.after))
    return law, Gap.closed_percent(before, after)


def ask_command(plan: Plan, folder: Path) -> Row:
    """Make a case, put it to `plumbline reconcile` as a process, and score the answer."""
    case = generate(plan, LENGTHS_S)
    write_case(case, folder)
    answer = folder / "answer.json"
    model = folder / "model.toml"
    files = {
        "--rig": folder / "rig.toml",
        "--held-out": folder / "held_out.csv",
        "--json": answer,
        "--write-model": model,
    }
    words = [str(word) for pair in files.items() for word in pair]
    begun_s = _children_cpu_s()
    command = [sys.executable, "-m", "gateway", "reconcile", str(folder / "log.csv"), *words]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if not answer.exists():
        raise RuntimeError(f"case {plan.index}: exit code {ended.returncode}: {ended.stderr.strip()[-300:]}")
    said = json.loads(answer.read_text())
    equation = said["equation"] or {"terms": [], "text": "", "closed_test_percent": None}
    row = _row(plan, case)
    row |= {
        "verdict": said["verdict"],
        "named": [each["name"] for each in said["effects"]],
        "terms": [each["name"] for each in equation["terms"]],
        "equation": equation["text"],
        "closed_test_percent": equation["closed_test_percent"],
        "alternatives": [other for each in equation["terms"] for other in each["alternatives"]],
        "cpu_s": round(_children_cpu_s() - begun_s, 1),
        "model_simulates": _simulates(model, [each["name"] for each in equation["terms"]]),
    }
    return row | {"score": score(row["hidden"], row["named"], row["terms"])}


def _simulates(model: Path, terms: list[str]) -> bool:
    """Whether `plumbline simulate` takes the written model, with every term of the law in it."""
    out = model.with_name("simulated.csv")
    command = [sys.executable, "-m", "gateway", "simulate", str(model), "--out", str(out), "--duration", "5"]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    return said.returncode == 0 and out.exists() and set(terms) <= set(tomllib.loads(model.read_text())["model"])


def _row(plan: Plan, case: Case) -> Row:
    hidden = plan.hidden[0] if plan.hidden else ""
    return {
        "index": plan.index,
        "hidden": hidden,
        "parameters": case.truth["effects"].get(hidden, {}),
        "small": plan.small,
        "coloured": plan.coloured,
        "excess": float(f"{case.truth['excess']:.3g}"),
    }


def _told(law: FoundLaw, name: str) -> str:
    term, values = TERMS[name], law.candidate.values[name]
    return f"{term.quantity} = {term.law(values)} ({term.in_words(values)})"


def _children_cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def score(hidden: str, named: list[str], terms: list[str]) -> str:
    """Return what an answer is worth: the right term must be the first, and no term may stand where none is hidden."""
    if hidden not in RIGHT_TERMS:
        return INVENTED if terms else NONE
    if (terms and terms[0] in RIGHT_TERMS[hidden]) or (set(named) & set(RIGHT_TERMS[hidden]) & CATALOGUE.keys()):
        return RIGHT
    return WRONG if terms or named else NOTHING


def report(rows: list[Row], seed: int) -> str:
    """Return the result as Markdown."""
    hidden = [row for row in rows if row["hidden"] in RIGHT_TERMS]
    right = sum(row["score"] == RIGHT for row in hidden)
    others = [row for row in rows if row["hidden"] not in RIGHT_TERMS]
    invented = sum(row["score"] == INVENTED for row in others)
    lines = [
        f"# Equations of what the catalogue does not hold, seed {seed}",
        "",
        f"Made by `python -m tests.blind.equations{' --command' if rows[0]['verdict'] else ''}`: "
        "recordings of the second simulator, "
        f"{LENGTHS_S['log']:.0f} s and {LENGTHS_S['held_out']:.0f} s at 50 Hz. CPU time of a case, median "
        f"{np.median([row['cpu_s'] for row in rows]):.1f} s, largest {max(row['cpu_s'] for row in rows):.1f} s.",
        "",
        f"Right term {right} of {len(hidden)}; terms invented {invented} of {len(others)} "
        f"({sum(not row['hidden'] for row in others)} hide nothing, the others a known effect).",
        "",
        "| hidden | cases | right | wrong term | no term | gap closed on the test part, median |",
        "|---|---|---|---|---|---|",
    ]
    for name in RIGHT_TERMS:
        own = [row for row in hidden if row["hidden"] == name]
        closed = [row["closed_test_percent"] for row in own if row["closed_test_percent"] is not None]
        counts = [str(sum(row["score"] == each for row in own)) for each in (RIGHT, WRONG, NOTHING)]
        median = f"{np.median(closed):.1f} %" if closed else ""
        lines.append(f"| {name} | {len(own)} | {' | '.join(counts)} | {median} |")
    lines += ["", "| hidden | excess | verdict | named | equation | score |", "|---|---|---|---|---|---|"]
    for row in sorted(rows, key=lambda each: (each["hidden"], each["index"])):
        name = (row["hidden"] or "nothing") + (", small" if row["small"] else "")
        equation = row["equation"].replace("|", "\\|")
        lines.append(
            f"| {name} | {row['excess']:g} | {row['verdict']} | {', '.join(row['named'])} | {equation} | {row['score']} |"
        )
    return "\n".join([*lines, ""])


def _rows(plans: list[Plan], done: dict[int, Row], *, command: bool) -> Iterator[Row]:
    for plan in plans:
        if plan.index in done:
            yield done[plan.index]
            continue
        if not command:
            yield ask(plan)
            continue
        with tempfile.TemporaryDirectory() as folder:
            yield ask_command(plan, Path(folder))


def main() -> int:
    """Run the campaign; rows that are in the file already are not asked again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.json")
    parser.add_argument("--report", type=Path, metavar="FILE.md")
    parser.add_argument(
        "--command", action="store_true", help="ask plumbline reconcile instead of the library of terms"
    )
    parser.add_argument("--cases", type=int, help="of the plan, from its start (default: all)")
    chosen = parser.parse_args()
    before = json.loads(chosen.out.read_text())["rows"] if chosen.out.exists() else []
    rows: list[Row] = []
    for row in _rows(
        plan_laws(chosen.seed)[: chosen.cases], {row["index"]: row for row in before}, command=chosen.command
    ):
        rows.append(row)
        listed = ",\n".join(json.dumps(each) for each in rows)
        chosen.out.write_text(f'{{"seed": {chosen.seed}, "rows": [\n{listed}\n]}}\n')
        print(row["index"], row["hidden"], row["score"], row["verdict"], row["equation"], row["cpu_s"], flush=True)
        if chosen.report is not None:
            chosen.report.write_text(report(rows, chosen.seed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
