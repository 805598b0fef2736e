"""Counts intervals that hold over planted sessions: `python -m tests.gateway.bench.intervals --sessions 600`.

`--kinds` takes those whose names contain a text; `--write` puts their rows into the table of the page, each as it comes.
`--results` keeps each session in a folder, from which a campaign of the same code goes on.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from tests.gateway.bench.intervals import service, temperature, workshop

PAGE = Path(__file__).parents[4] / "docs" / "evidence" / "bench_methods.md"
MARKS = ("<!-- written by python -m tests.gateway.bench.intervals --write -->", "<!-- end -->")
HEAD = ("| sessions of | sessions | intervals | hold / % |", "|---|---|---|---|")
REFUSED = "-"
"""A session that was refused, and has no interval."""
KINDS = {**temperature.KINDS, **service.KINDS, **workshop.KINDS}


def hits(kind: str, sessions: int, folder: Path) -> list[list[bool]]:
    """Return for each interval of each session whether it holds; those that the folder has are not run again."""
    file = folder / f"{kind}.txt"
    known = file.read_text().split() if file.exists() else []
    with file.open("a") as out:
        for seed in range(len(known), sessions):
            known.append("".join(str(int(hit)) for hit in KINDS[kind](seed)) or REFUSED)
            print(known[-1], file=out, flush=True)
    return [[hit == "1" for hit in session if session != REFUSED] for session in known[:sessions]]


def row(kind: str, found: list[list[bool]]) -> str:
    """Return the row of a kind."""
    every = np.concatenate(found).astype(float)
    shares = [np.mean(each) for each in found if each]
    u_percent = 100 * np.std(shares) / np.sqrt(len(shares))
    return f"| {kind} | {len(found)} | {every.size} | {100 * every.mean():.1f} ± {u_percent:.1f} |"


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
    parser.add_argument("--results", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        for kind in KINDS:
            if arguments.kinds in kind:
                found = row(kind, hits(kind, arguments.sessions, arguments.results or Path(scratch)))
                print(found, flush=True)
                if arguments.write:
                    write(found)


if __name__ == "__main__":
    main()
