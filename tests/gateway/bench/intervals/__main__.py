"""Counts intervals that hold over planted sessions: `python -m tests.gateway.bench.intervals --sessions 600`.

`--kinds` takes those whose names contain a text; `--write` puts the table into its page.
"""

import argparse
from pathlib import Path

import numpy as np

from tests.gateway.bench.intervals import service, temperature, workshop

PAGE = Path(__file__).parents[4] / "docs" / "evidence" / "bench_methods.md"
MARKS = ("<!-- written by python -m tests.gateway.bench.intervals --write -->", "<!-- end -->")
KINDS = {**temperature.KINDS, **service.KINDS, **workshop.KINDS}
SLOW = {
    "laser, JPEG of quality 75": 10,
    **{kind: 2 for kind in temperature.KINDS if kind.startswith("at rest")},
    **dict.fromkeys(service.KINDS, 5),
}
"""Kinds that have a fraction of the sessions."""


def rows(sessions: int, kinds: str = "") -> list[str]:
    """Return the rows of the table, and print each as it comes."""
    found = []
    for name, session in KINDS.items():
        if kinds in name:
            count = sessions // SLOW.get(name, 1)
            sessions_hit = [session(seed) for seed in range(count)]
            hits = np.concatenate(sessions_hit).astype(float)
            u_percent = 100 * np.std([np.mean(each) for each in sessions_hit]) / np.sqrt(count)
            found.append(f"| {name} | {count} | {hits.size} | {100 * hits.mean():.1f} ± {u_percent:.1f} |")
            print(found[-1], flush=True)
    return found


def main() -> None:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=600)
    parser.add_argument("--kinds", default="")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    table = [
        "| sessions of | sessions | intervals | hold / % |",
        "|---|---|---|---|",
        *rows(arguments.sessions, arguments.kinds),
    ]
    if arguments.write:
        before, rest = PAGE.read_text().split(MARKS[0])
        PAGE.write_text("\n".join([f"{before}{MARKS[0]}", "", *table, "", f"{MARKS[1]}{rest.split(MARKS[1])[1]}"]))


if __name__ == "__main__":
    main()
