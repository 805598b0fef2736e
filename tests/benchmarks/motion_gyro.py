"""The angle of a working crane with and without a gyroscope: rms error and share inside the 95 % interval by manoeuvre."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.motion import BLOCK, replace_tables, table
from tests.benchmarks.motion_recordings import MANOEUVRES, MOUNT_U_RAD, WorkRecording, generate

NOISE_RAD_S_PER_ROOT_HZ = np.radians(0.01)
BIAS_LIMIT_RAD_S = np.radians(5.0)
"""An MPU-9250 by its data sheet."""
BIAS_RAD_S, BIAS_WALK_RAD_S = np.radians(1.0), np.radians(5e-4)
SCALE_ERROR, CROSS_AXIS = 0.01, 0.005
"""Standard deviations of the planted errors; the walk per root of a second."""


@dataclass(frozen=True, slots=True)
class Followed:
    """Errors of one recording after its first period, deg."""

    manoeuvre: np.ndarray
    error: Array
    u: Array


def gyro_readings(recording: WorkRecording, seed: int) -> Array:
    """Return the reading of a gyroscope with bias, scale errors, cross-axis sensitivity and noise, rad/s, shape (n, 3)."""
    assert recording.rate_rad_s is not None
    rng = np.random.default_rng([seed, 7])
    step_s = np.diff(recording.time_s, prepend=recording.time_s[0])
    gain = np.eye(3) + np.diag(SCALE_ERROR * rng.normal(size=3)) + CROSS_AXIS * rng.normal(size=(3, 3))
    bias = BIAS_RAD_S * rng.normal(size=3)
    walk = np.cumsum(
        BIAS_WALK_RAD_S * np.sqrt(np.maximum(step_s, 0))[:, None] * rng.normal(size=(len(step_s), 3)), axis=0
    )
    noise = NOISE_RAD_S_PER_ROOT_HZ * np.sqrt(0.5 / np.median(step_s)) * rng.normal(size=(len(step_s), 3))
    readings: Array = recording.rate_rad_s @ gain.T + bias + walk + noise
    return readings


def follow(recording: WorkRecording, rate_rad_s: Array | None) -> Followed:
    """Return the errors of a live filter at every tenth of a second."""
    gyro = None if rate_rad_s is None else GyroPrior(BIAS_LIMIT_RAD_S / 3**0.5)
    monitor = MotionMonitor(recording.rig, mount_u_rad=MOUNT_U_RAD, gyro=gyro)
    rows = []
    for begin in range(0, len(recording.time_s), BLOCK):
        part = slice(begin, begin + BLOCK)
        time_s = recording.time_s[part]
        monitor.update(time_s, recording.force_g[part], None, None if rate_rad_s is None else rate_rad_s[part])
        e = monitor.estimate(float(time_s[-1]))
        rows.append((e.time_s, e.angle_rad, e.u_rad))
    time_s, angle, u = np.array(rows, dtype=np.float64).T
    counted = time_s > recording.period_s
    error = np.degrees(angle[counted]) - recording.true("angle_deg", time_s[counted])
    return Followed(recording.manoeuvre(time_s[counted]), error, np.degrees(u[counted]))


def compare(recordings: Sequence[WorkRecording]) -> str:
    """Return the table."""
    plain = _joined([follow(each, None) for each in recordings])
    with_gyro = _joined([follow(each, gyro_readings(each, number)) for number, each in enumerate(recordings)])
    header = [
        "manoeuvre",
        "rms without",
        "rms with",
        "inside without",
        "inside with",
        "half width without",
        "half width with",
    ]
    body = []
    for place, name in enumerate((*MANOEUVRES, "all")):
        rows = [name]
        shown = [[], [], []]  # type: list[list[str]]
        for each in (plain, with_gyro):
            at = np.isfinite(each.error) & ((each.manoeuvre == place) | (name == "all"))
            error, half = each.error[at], NORMAL_975 * each.u[at]
            shown[0].append(f"{np.sqrt(np.mean(error**2)):.3f}")
            shown[1].append(f"{100 * np.mean(np.abs(error) < half):.1f} %")
            shown[2].append(f"{np.median(half):.3f}")
        body.append([*rows, *shown[0], *shown[1], *shown[2]])
    return table(header, body)


def _joined(parts: Sequence[Followed]) -> Followed:
    return Followed(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("manoeuvre", "error", "u")))


def main(arguments: Sequence[str] = ()) -> None:
    """Print the table, and write it into a page where wanted."""
    parser = argparse.ArgumentParser(prog="script/bench motion_gyro", description=__doc__)
    parser.add_argument("--kind", default="plain", help="of the recordings that are made")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="replace the table of this page")
    chosen = parser.parse_args(arguments)
    found = compare(list(generate(chosen.kind, chosen.seed, chosen.count)))
    print(f"motion with a gyroscope\n{found}\n")
    if chosen.write is not None:
        chosen.write.write_text(replace_tables(chosen.write.read_text(), {"gyro": found}))
