"""Recordings of real pendulums: what is known independently, what `measure` and `reconcile` answer, and two simpler methods.

`python -m tests.benchmarks.real_recordings FOLDER --out TABLE.md` asks for each recording of real_recordings.toml that FOLDER
contains. The recordings are not part of the project; the manifest names their sources, commits and checksums. With `--answers`,
answers are kept in a folder, and what it contains is not asked again.
"""

import argparse
import hashlib
import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.benchmarks.real_angles import as_at_pivot, known_angles
from tests.benchmarks.real_manifest import RealRecording, read_manifest
from tests.benchmarks.real_table import Row, markdown, measure_cells, reconcile_cells, tables

LIMIT_S = 600.0
COMMANDS = {
    "measure": ("gateway", "measure"),
    "reconcile": ("gateway", "reconcile"),
    "everything": ("tests.benchmarks.real_baselines", "everything"),
    "sparse": ("tests.benchmarks.real_baselines", "sparse"),
}
"""Module and verb of each method."""
WITHOUT_BASELINES = ("measure", "reconcile")


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of each recording, and where answers are kept."""

    methods: Sequence[str]
    kept: Path | None


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each recording as it is answered, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", default="", help="part of a name or of a path")
    parser.add_argument("--methods", nargs="+", choices=list(COMMANDS), default=list(WITHOUT_BASELINES))
    parser.add_argument("--baselines", action="store_true", help="all methods")
    parser.add_argument(
        "--answers", type=Path, metavar="FOLDER", help="keep answers here; those that it has are not asked"
    )
    chosen = parser.parse_args(arguments)
    question = Question(list(COMMANDS) if chosen.baselines else chosen.methods, chosen.answers)
    rows = []
    for row in _rows(chosen.folder, chosen.only, question):
        rows.append(row)
        print(markdown([*measure_cells(row), *reconcile_cells(row)[1:]]), flush=True)
    if chosen.out is not None:
        chosen.out.write_text(tables(rows), encoding="utf-8")


def _rows(folder: Path, only: str, question: Question) -> Iterator[Row]:
    for recording in read_manifest():
        if only not in recording.name and only not in recording.path:
            continue
        row = ask(recording, folder, question)
        if row is None:
            print(f"{recording.name}: not in {folder}", file=sys.stderr)
        else:
            yield row


def ask(recording: RealRecording, folder: Path, question: Question) -> Row | None:
    """Ask all methods; None where the recording is not there. Raises `ValueError` for another checksum."""
    path = folder / recording.path
    if not path.exists():
        return None
    if hashlib.sha256(path.read_bytes()).hexdigest() != recording.sha256:
        raise ValueError(f"{path}: is not the file of the manifest")
    with tempfile.TemporaryDirectory() as scratch:
        rig = Path(scratch, "rig.toml")
        rig.write_text(recording.rig, encoding="utf-8")
        log = as_at_pivot(recording, path, Path(scratch, "angles.csv")) if recording.angle else path
        asked = [str(log), "--rig", str(rig), *recording.options]
        answers = {each: _kept_or_asked(recording, each, asked, question.kept) for each in question.methods}
    return Row(recording, known_angles(recording, path), answers)


def _kept_or_asked(
    recording: RealRecording, method: str, arguments: Sequence[str], kept: Path | None
) -> Mapping[str, Any]:
    if kept is None:
        return answer(method, arguments)
    file = kept / f"{re.sub(r'[^a-z0-9]+', '_', recording.name.lower())}.{method}.json"
    if not file.exists():
        kept.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(answer(method, arguments)), encoding="utf-8")
    found: Mapping[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def answer(method: str, arguments: Sequence[str]) -> Mapping[str, Any]:
    """The JSON of a method with how long it took, `wall_s`, and its CPU time, `cpu_s`, or why it has none."""
    began_s, cpu_began_s = time.monotonic(), _cpu_of_children_s()
    asked = [sys.executable, "-m", *COMMANDS[method], *arguments, "--json", "-"]
    try:
        done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        return {"error": f"more than {LIMIT_S:g} s", "wall_s": LIMIT_S, "cpu_s": _cpu_of_children_s() - cpu_began_s}
    taken = {"wall_s": time.monotonic() - began_s, "cpu_s": _cpu_of_children_s() - cpu_began_s}
    if not done.stdout.startswith("{"):
        said = (done.stderr.strip().splitlines() or ["no answer"])[-1].removeprefix(f"plumbline {method}: ")
        said = said.removeprefix(f"{arguments[0]}: ")
        for folder in {Path(arguments[0]).parent, Path(arguments[2]).parent}:  # of the log and of the rig
            said = said.replace(f"{folder}/", "")
        return {"error": said, **taken}
    return {**json.loads(done.stdout), **taken}


def _cpu_of_children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
