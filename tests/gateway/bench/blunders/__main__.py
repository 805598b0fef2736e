"""Runs the campaign: `python -m tests.gateway.bench.blunders --sessions 10`; `--write` puts the table into its page."""

import argparse
from pathlib import Path

from tests.gateway.bench.blunders.campaign import BLUNDERS, SOUND, run

PAGE = Path(__file__).parents[4] / "docs" / "evidence" / "blunders.md"
MARK = "<!-- written by python -m tests.gateway.bench.blunders --write -->"

GOOD = 4
"""Good sessions of a method for each session of a blunder: a share of 99 % shows in hundreds."""


def campaign(sessions: int, first_seed: int = 1) -> str:
    """Return the table of what is refused or flagged, as Markdown."""
    seeds = range(first_seed, first_seed + sessions)
    lines, caught = [], 0
    for blunder in BLUNDERS:
        answers = [run(blunder.make, seed, blunder.method + blunder.text) for seed in seeds]
        named = [answer for answer in answers if answer.names(blunder.suspicion)]
        refused = sum(answer.code > 0 for answer in named)
        caught += len(named)
        lines.append(
            f"| {blunder.method} | {blunder.text} | {refused} | {len(named) - refused} | {sessions - len(named)} |"
        )
    good_seeds = range(first_seed, first_seed + GOOD * sessions)
    good = {name: [run(make, seed, name) for seed in good_seeds] for name, make in SOUND.items()}
    objections = {name: sum(answer.is_objection for answer in answers) for name, answers in good.items()}
    total, sound = sessions * len(BLUNDERS), len(good_seeds) * len(SOUND)
    share = f"{caught} of {total} ({100 * caught / total:.1f} %)"
    return "\n".join(
        [
            f"{len(BLUNDERS)} blunders, {sessions} sessions of each: {share} are refused or flagged with the right suspicion.",
            f"Of {sound} good sessions {sum(objections.values())} are refused or flagged.",
            "",
            "| method | blunder | refused | flagged | neither |",
            "|---|---|---|---|---|",
            *lines,
            "",
            "| good sessions | refused or flagged |",
            "|---|---|",
            *(f"| {name} | {count} of {len(good_seeds)} |" for name, count in objections.items()),
            "",
        ]
    )


def main() -> None:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    table = campaign(arguments.sessions, arguments.seed)
    print(table)
    if arguments.write:
        head = PAGE.read_text().split(MARK)[0]
        PAGE.write_text(f"{head}{MARK}\n\n{table}")


if __name__ == "__main__":
    main()
