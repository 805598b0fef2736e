"""Write recordings of a working crane: `python -m tests.working_crane OUT --seed N --count M [--kind KIND]`."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.working_crane.crane import Case
from tests.working_crane.kinds import KINDS, WIDEST_DEG, case_seeds
from tests.working_crane.recording import Recording, record
from tests.working_crane.write import write_case


def main(arguments: Sequence[str] | None = None) -> None:
    """Write OUT/work_000 and so on."""
    parser = argparse.ArgumentParser(prog="python -m tests.working_crane", description=__doc__)
    parser.add_argument("out", type=Path, help="folder for the cases")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=16)
    parser.add_argument("--kind", choices=sorted(KINDS), default="plain")
    chosen = parser.parse_args(arguments)
    for index, seed in enumerate(case_seeds(chosen.seed, chosen.count)):
        case, recording = make(chosen.kind, seed)
        write_case(case, recording, chosen.out / f"work_{index:03d}")


def make(kind: str, seed: int) -> tuple[Case, Recording]:
    """Return a case and its recording; a `wide` one is drawn again until its largest angle is as wanted."""
    case = KINDS[kind](seed)
    recording = record(case)
    while kind == "wide" and not WIDEST_DEG[0] < recording.largest_deg < WIDEST_DEG[1]:
        case = KINDS[kind](case_seeds(case.seed, 1)[0])
        recording = record(case)
    return case, recording


if __name__ == "__main__":
    main()
