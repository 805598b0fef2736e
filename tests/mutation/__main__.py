"""Runs the mutations: `script/mutate`, or `script/mutate ZHU` for the papers whose title contains a word in any case."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.mutation.mutants import mutants
from tests.test_equations import NAME, expanded, sections

ROOT = Path(__file__).parents[2]
PER_EQUATION = 2
PARTS = (
    "gateway",
    "devices",
    "tests",
    "docs",
    "config",
    "script",
    "deploy",
    "pyproject.toml",
    "CHANGELOG.md",
    "README.md",
)
"""What the tests of an equation need."""


@dataclass(frozen=True, slots=True)
class Mutation:
    """One broken equation."""

    paper: str
    numbers: str
    path: str
    name: str
    text: str
    source: str
    tests: tuple[str, ...]


def plan(word: str) -> list[Mutation]:
    """Return the mutations of all rows: two for each numbered equation, spread over the ways to break its code."""
    found = []
    for paper, rows in sections().items():
        for numbers, _, code, test, _ in rows:
            ways = [
                (module.replace(".", "/") + ".py", name, text, source)
                for module, name in NAME.findall(code)
                for text, source in mutants(
                    (ROOT / (module.replace(".", "/") + ".py")).read_text(), name, expanded(numbers)
                )
            ]
            wanted = min(PER_EQUATION * len(expanded(numbers)), len(ways))
            tests = tuple(test.replace("`", "").split(", "))
            for number in range(wanted if word.lower() in paper.lower() else 0):
                found.append(Mutation(paper, numbers, *ways[number * len(ways) // wanted], tests))
    return found


def is_caught(copy: Path, mutation: Mutation) -> bool:
    """Return whether the named tests fail with the mutation in a copy of the program."""
    file = copy / mutation.path
    kept = file.read_text()
    file.write_text(mutation.source)
    try:
        return any(_fails(copy, mutation, which) for which in ("not slow", "slow"))
    finally:
        file.write_text(kept)


def _fails(copy: Path, mutation: Mutation, which: str) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", "-m", which]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([*command, *mutation.tests], cwd=copy, env=environment, capture_output=True, check=False)
    return done.returncode == 1


def main() -> None:
    """Run the mutations and print the score by paper, and what no test caught."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paper", nargs="?", default="")
    mutations = plan(parser.parse_args().paper)
    score: dict[str, list[bool]] = {}
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in PARTS:
            place = ROOT / part
            if place.is_dir():
                shutil.copytree(place, copy / part, ignore=shutil.ignore_patterns("__pycache__", "*.mcap"))
            elif place.exists():
                shutil.copy(place, copy / part)
        for number, mutation in enumerate(mutations, start=1):
            caught = is_caught(copy, mutation)
            score.setdefault(mutation.paper, []).append(caught)
            if not caught:
                print(
                    f"not caught: {mutation.paper}, eq. {mutation.numbers}: {mutation.name}, {mutation.text}",
                    flush=True,
                )
            if number % 20 == 0:
                print(f"{number} of {len(mutations)}", file=sys.stderr, flush=True)
    for paper, caught_ones in score.items():
        print(f"{paper}: {sum(caught_ones)} of {len(caught_ones)}")
    total = [one for ones in score.values() for one in ones]
    print(f"all: {sum(total)} of {len(total)}")


if __name__ == "__main__":
    main()
