"""Counts intervals that hold over planted sessions: `python -m tests.gateway.bench.intervals --sessions 600`.

`--kinds` takes those whose names contain a text; `--write` puts their rows into the table of the page, each as it comes.
"""

import argparse
from pathlib import Path

import numpy as np

from tests.gateway.bench.intervals import service, temperature, workshop

PAGE = Path(__file__).parents[4] / "docs" / "evidence" / "bench_methods.md"
MARKS = ("<!-- written by python -m tests.gateway.bench.intervals --write -->", "<!-- end -->")
HEAD = ("| sessions of | sessions | intervals | hold / % |", "|---|---|---|---|")
KINDS = {**temperature.KINDS, **service.KINDS, **workshop.KINDS}
SLOW = {"laser, JPEG of quality 75": 3, **dict.fromkeys(service.KINDS, 3)}
"""Kinds that have a fraction of the sessions: those that take more than 10 minutes otherwise."""


def row(kind: str, sessions: int) -> str:
    """Return the row of a kind."""
    hits = [KINDS[kind](seed) for seed in range(sessions)]
    every = np.concatenate(hits).astype(float)
    u_percent = 100 * np.std([np.mean(each) for each in hits]) / np.sqrt(sessions)
    return f"| {kind} | {sessions} | {every.size} | {100 * every.mean():.1f} ± {u_percent:.1f} |"


def write(found: str) -> None:
    """Put a row into the table of the page, in the order of the kinds."""
    before, rest = PAGE.read_text().split(MARKS[0])
    table, after = rest.split(MARKS[1])
    rows = {line.split(" | ")[0]: line for line in [*table.split("\n"), found] if line.startswith("| ")}
    ordered = [rows[f"| {kind}"] for kind in KINDS if f"| {kind}" in rows]
    PAGE.write_text("\n".join([f"{before}{MARKS[0]}", "", *HEAD, *ordered, "", f"{MARKS[1]}{after}"]))


def main() -> None:
    """Run the campaign and print its rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=600)
    parser.add_argument("--kinds", default="")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    for kind in KINDS:
        if arguments.kinds in kind:
            found = row(kind, arguments.sessions // SLOW.get(kind, 1))
            print(found, flush=True)
            if arguments.write:
                write(found)


if __name__ == "__main__":
    main()
