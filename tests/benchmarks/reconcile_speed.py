"""CPU time of `reconcile` on swings that it cannot explain or hardly can, beside that of another version of the program.

    python -m tests.benchmarks.reconcile_speed FOLDER --before OTHER_TREE [--only PART_OF_A_NAME]

FOLDER has the recordings of real_recordings.toml; one that the vocabulary cannot explain is simulated: four causes at once. Both
versions are asked in turn, so that what else runs on the machine slows both.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tests.benchmarks.real_angles import as_at_pivot
from tests.benchmarks.real_manifest import read_manifest
from tests.blind.rigid_pendulum import RigidPendulum, simulate

HERE = Path(__file__).parents[2]
RATE_HZ, DURATION_S, NOISE_G = 100.0, 60.0, 1e-3


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each recording, and the median and largest time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--before", type=Path, required=True, metavar="OTHER_TREE")
    parser.add_argument("--only", default="")
    chosen = parser.parse_args(arguments)
    times_s = []
    with tempfile.TemporaryDirectory() as scratch:
        for name, asked in _questions(chosen.folder, Path(scratch)):
            if chosen.only not in name:
                continue
            (before, before_s), (after, after_s) = (_ask(tree, asked) for tree in (chosen.before, HERE))
            times_s.append((before_s, after_s))
            print(f"{name}: {before_s:.1f} s -> {after_s:.1f} s; {before} -> {after}", flush=True)
    if times_s:
        for label, of in (("median", np.median), ("largest", np.max)):
            before_s, after_s = of(np.array(times_s), axis=0)
            print(f"{label}: {before_s:.1f} s -> {after_s:.1f} s of CPU time")


def _questions(folder: Path, scratch: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield the arguments of `reconcile` for each recording."""
    for number, recording in enumerate(read_manifest()):
        path = folder / recording.path
        if not path.exists():
            continue
        rig, log = scratch / f"{number}.toml", path
        rig.write_text(recording.rig, encoding="utf-8")
        if recording.angle:
            log = as_at_pivot(recording, path, scratch / f"{number}.csv")
        yield recording.name, [str(log), "--rig", str(rig), *recording.options]
    yield "simulated, four causes", _simulated(scratch)


def _simulated(scratch: Path) -> list[str]:
    body = RigidPendulum(line_m=4.0, sensor_m=2.0, damping_ratio=0.002, drag=0.01, friction=0.002, wind=(0.02, 0.01))
    motion = simulate(body, np.radians(60.0), 0.5, 0.05, DURATION_S)
    time_s = np.arange(0, DURATION_S, 1 / RATE_HZ)
    force_g = np.stack([np.interp(time_s, motion.time_s, axis) for axis in motion.force_g.T], axis=1)
    force_g += NOISE_G * np.random.default_rng(1).normal(size=force_g.shape)
    log, rig = scratch / "simulated.csv", scratch / "simulated.toml"
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(log, np.column_stack([time_s, force_g]), fmt="%.6f", delimiter=",", header=header, comments="")
    rig.write_text(f"[rope]\nlength_m = 4.0\n[housing]\nposition_m = 2.0\n[sensor]\nnoise_g = {NOISE_G}\n")
    return [str(log), "--rig", str(rig)]


def _ask(tree: Path, arguments: Sequence[str]) -> tuple[str, float]:
    """Return verdict, names and gap of the test part, and the CPU seconds, of the program in a folder."""
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    asked = [sys.executable, "-m", "gateway", "reconcile", *arguments, "--json", "-"]
    surroundings = {**os.environ, "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(asked, capture_output=True, text=True, check=False, cwd=tree, env=surroundings)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
    if not done.stdout.startswith("{"):
        return (done.stderr.strip().splitlines() or ["no answer"])[-1], cpu_s
    said = json.loads(done.stdout)
    names = "+".join([*(each["name"] for each in said["effects"]), *said["candidates"]]) or "nothing"
    gap = said.get("gap") or {}
    closed = f" {gap['before']['test']:.3g} to {gap['after']['test']:.3g}" if gap.get("before") else ""
    return f"{said['verdict']} {names}{closed}", cpu_s


if __name__ == "__main__":
    main()
