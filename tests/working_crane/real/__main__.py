"""Write recordings of cranes as they are: `python -m tests.working_crane.real OUT --seed N --count M [--kind a]`."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.working_crane.real.kinds import KINDS
from tests.working_crane.real.recording import make
from tests.working_crane.real.write import write_recording


def main(arguments: Sequence[str] | None = None) -> None:
    """Write OUT/work_a00 and so on, `count` of each kind."""
    parser = argparse.ArgumentParser(prog="python -m tests.working_crane.real", description=__doc__)
    parser.add_argument("out", type=Path, help="folder for the recordings")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=4, help="recordings of each kind; the variants take turns")
    parser.add_argument("--kind", choices=sorted(KINDS), help="one kind alone")
    parser.add_argument("--duration", type=float, default=180.0, help="seconds")
    parser.add_argument("--rate", type=float, help="Hz; drawn from 50 to 125 where not given")
    chosen = parser.parse_args(arguments)
    for kind in [chosen.kind] if chosen.kind else sorted(KINDS):
        for index in range(chosen.count):
            try:
                recording = make(kind, chosen.seed, index, chosen.duration, chosen.rate)
            except RuntimeError as error:
                print(f"left out: {error}")
                continue
            write_recording(recording, chosen.out / f"work_{kind}{index:02d}")


if __name__ == "__main__":
    main()
