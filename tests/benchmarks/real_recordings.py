"""Recordings of real pendulums: what is known independently, what `measure` and `reconcile` answer, and two simpler methods.

`python -m tests.benchmarks.real_recordings FOLDER --out TABLE.md` asks for each recording of real_recordings.toml that FOLDER
contains. The recordings are not part of the project; the manifest names their sources, commits and checksums. A recording of
angles becomes what a housing at the pivot reads, f = (sin φ, 0, cos φ) g, turned by 45° about the rope: x and y both swing.
"""

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MANIFEST = Path(__file__).with_suffix(".toml")
LIMIT_S = 600.0
BASELINES = ("everything", "sparse")
"""Modules of tests.blind.baselines: least squares of everything at once, and sparse regression by pysindy."""
LOG_SHARE = 2 / 3
"""Share of a recording that the simpler methods are fitted to; `reconcile` divides it by itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealRecording:
    """An entry of the manifest."""

    name: str
    path: str
    source: str
    licence: str
    sha256: str
    rig: str
    options: Sequence[str] = ()
    angle: Mapping[str, float] = field(default_factory=dict)
    known_deg: tuple[float, float]
    """Largest angle and its standard uncertainty, known independently."""
    known_from: str
    plausible: Sequence[str]
    """Effects that an engineer would sign."""

    @property
    def is_set_aside(self) -> bool:
        """Whether nobody looked at it while anything was tuned."""
        return self.path.startswith("aside/")


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table."""

    recording: RealRecording
    measured: Mapping[str, Any]
    reconciled: Mapping[str, Any]
    seconds: tuple[float, float]
    baselines: Mapping[str, str]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each recording as it is answered, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", default="", help="part of a name, or work/ or aside/")
    parser.add_argument("--baselines", action="store_true")
    chosen = parser.parse_args(arguments)
    rows = []
    for recording in read_manifest():
        if chosen.only not in recording.name and not recording.path.startswith(chosen.only or "work/"):
            continue
        row = ask(recording, chosen.folder, with_baselines=chosen.baselines)
        if row is None:
            print(f"{recording.name}: not in {chosen.folder}", file=sys.stderr)
            continue
        rows.append(row)
        print(line(row), flush=True)
    if chosen.out is not None:
        chosen.out.write_text("\n".join([*HEAD, *map(line, rows), ""]), encoding="utf-8")


def read_manifest() -> list[RealRecording]:
    """All entries."""
    entries = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["recording"]
    return [RealRecording(**{**entry, "known_deg": tuple(entry["known_deg"])}) for entry in entries]


def ask(recording: RealRecording, folder: Path, *, with_baselines: bool) -> Row | None:
    """Ask both commands; None where the recording is not there. Raises `ValueError` for another checksum."""
    path = folder / recording.path
    if not path.exists():
        return None
    if hashlib.sha256(path.read_bytes()).hexdigest() != recording.sha256:
        raise ValueError(f"{path}: is not the file of the manifest")
    with tempfile.TemporaryDirectory() as scratch:
        rig = Path(scratch) / "rig.toml"
        rig.write_text(recording.rig, encoding="utf-8")
        log = as_at_pivot(recording, path, Path(scratch) / "angles.csv") if recording.angle else path
        arguments = [str(log), "--rig", str(rig), *recording.options]
        answers, seconds = zip(*(answer(command, arguments) for command in ("measure", "reconcile")), strict=True)
        simpler = dict(baseline_answers(log, rig)) if with_baselines and recording.angle else {}
    return Row(recording, answers[0], answers[1], seconds, simpler)


def answer(command: str, arguments: Sequence[str]) -> tuple[Mapping[str, Any], float]:
    """The JSON of a command, and how long it took."""
    began_s = time.perf_counter()
    asked = [sys.executable, "-m", "gateway", command, *arguments, "--json", "-"]
    try:
        done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        return {"error": f"more than {LIMIT_S:g} s"}, LIMIT_S
    taken_s = time.perf_counter() - began_s
    if not done.stdout.startswith("{"):
        return {"error": (done.stderr.strip().splitlines() or ["no answer"])[-1]}, taken_s
    return json.loads(done.stdout), taken_s


def as_at_pivot(recording: RealRecording, path: Path, out: Path) -> Path:
    """Write the readings of a housing at the pivot; rows without numbers are left out, and times count from the first row."""
    of = recording.angle
    rows = np.array(list(_numbers(path, [int(of["time_column"]), int(of["column"])])))
    time_s = (rows[:, 0] - rows[0, 0]) * of.get("time_unit_s", 1.0)
    angle_rad = rows[:, 1] * of.get("unit_rad", 1.0) - of.get("hanging_rad", 0.0)
    inside = (time_s >= of.get("from_s", 0.0)) & (time_s <= of.get("to_s", np.inf))
    lateral_g = np.sin(angle_rad[inside]) * np.sqrt(0.5)
    table = [time_s[inside], lateral_g, lateral_g, np.cos(angle_rad[inside])]
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(out, np.column_stack(table), fmt="%.6f", delimiter=",", header=header, comments="")
    return out


def _numbers(path: Path, columns: Sequence[int]) -> Iterator[list[float]]:
    for text in path.read_text(encoding="utf-8").splitlines():
        fields = re.split(r"\s*[,;]\s*|\s+", text.strip())
        try:
            yield [float(fields[column]) for column in columns]
        except (ValueError, IndexError):
            continue


def baseline_answers(log: Path, rig: Path) -> Iterator[tuple[str, str]]:
    """What the simpler methods answer on the same recording, divided into two parts by time."""
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    table = np.column_stack([table, np.full(len(table), 20.0)])
    last = int(LOG_SHARE * len(table))
    header = "time_s,ax_g,ay_g,az_g,temperature_c"
    parts = [log.with_name(name) for name in ("log.csv", "held_out.csv")]
    for part, rows in zip(parts, (table[:last], table[last:]), strict=True):
        np.savetxt(part, rows, fmt="%.6f", delimiter=",", header=header, comments="")
    full_rig = rig.with_name("baseline_rig.toml")
    full_rig.write_text(rig.read_text() + "[site]\ngravity_m_s2 = 9.80665\n")
    for name in BASELINES:
        found, prediction = log.with_name(f"{name}.json"), log.with_name(f"{name}.csv")
        asked = [
            sys.executable,
            "-m",
            f"tests.blind.baselines.{name}",
            "reconcile",
            str(parts[0]),
            "--rig",
            str(full_rig),
        ]
        asked += ["--held-out", str(parts[1]), "--json", str(found), "--prediction", str(prediction)]
        try:
            done = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            yield name, f"more than {LIMIT_S:g} s"
            continue
        if not found.exists():
            yield name, (done.stderr.strip().splitlines() or ["no answer"])[-1]
            continue
        said = json.loads(found.read_text())
        names = ", ".join(each["name"] for each in said["effects"]) or "nothing"
        yield (
            name,
            f"{names}; {_number(said['gap']['before']['held_out'])} → {_number(said['gap']['after']['held_out'])}",
        )


COLUMNS = (
    "recording",
    "known, deg",
    "`measure`, deg",
    "verdict",
    "effects",
    "gap of the test part",
    "plausible",
    "s",
    "least squares of everything",
    "pysindy",
)
HEAD = ("| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|")


def line(row: Row) -> str:
    """The line of the table."""
    known, uncertainty = row.recording.known_deg
    names = [effect["name"] for effect in row.reconciled.get("effects", [])]
    strange = [name for name in names if name not in row.recording.plausible]
    judged = "-" if not names else "no: " + ", ".join(strange) if strange else "yes"
    cells = (
        row.recording.name,
        f"{known:g} ± {2 * uncertainty:g}",
        _angle(row.measured, known, uncertainty),
        row.reconciled.get("verdict", row.reconciled.get("error", "")),
        _effects(row.reconciled),
        _gap(row.reconciled),
        judged,
        "{:.0f}, {:.0f}".format(*row.seconds),
        *(row.baselines.get(name, "-") for name in BASELINES),
    )
    return "| " + " | ".join(str(cell).replace("|", "/") for cell in cells) + " |"


def _angle(measured: Mapping[str, Any], known_deg: float, uncertainty_deg: float) -> str:
    """The interval, and whether it contains the known angle within its own uncertainty; else that of the smoothed motion."""
    swing, motion = measured.get("swing") or {}, measured.get("motion") or {}
    largest = motion.get("largest") or {}
    if swing.get("coverage95_deg"):
        return _interval(swing["phi_max_deg"], swing["coverage95_deg"], known_deg, uncertainty_deg)
    if largest.get("coverage95_deg"):
        said = _interval(largest["angle_deg"], largest["coverage95_deg"], known_deg, uncertainty_deg)
        return f"unknown; while the angle is known ({motion['known_percent']:.0f} %) {said}"
    return "unknown: " + "; ".join(swing.get("reasons") or [measured.get("error", "")])


def _interval(angle_deg: float, low_high_deg: Sequence[float], known_deg: float, uncertainty_deg: float) -> str:
    low, high = low_high_deg
    holds = low - 2 * uncertainty_deg <= known_deg <= high + 2 * uncertainty_deg
    return f"{angle_deg:.2f} ({low:.2f} to {high:.2f})" + ("" if holds else " **misses**")


def _effects(reconciled: Mapping[str, Any]) -> str:
    said = [f"{effect['name']} ({_sizes(effect['parameters'])})" for effect in reconciled.get("effects", [])]
    laws = [each["text"] for each in (reconciled.get("equation") or {}).get("terms", []) if "text" in each]
    return "; ".join([*said, *laws]) or str(reconciled.get("reason", ""))


def _sizes(parameters: Mapping[str, Any]) -> str:
    numbers = {key: each["value"] for key, each in parameters.items()}
    return ", ".join(
        f"{key} {[float(_number(one)) for one in value]}" if isinstance(value, list) else f"{key} {_number(value)}"
        for key, value in numbers.items()
    )


def _gap(reconciled: Mapping[str, Any]) -> str:
    gap = reconciled.get("gap") or {}
    if not gap.get("before"):
        return "-"
    return f"{_number(gap['before']['test'])} → {_number(gap['after']['test'])}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


if __name__ == "__main__":
    main()
