"""Swings of rigid pendulums that are not what the rig says: how often `measure` answers, and how often it is right.

    python -m tests.benchmarks.rigid_swing [CASES] [SEED] [--wide]

Half are short lines (0.15 to 0.8 m, sensor near the bob), half crane ropes (2 to 15 m); with --wide all are short lines that
swing from 60 to 145 degrees, sensor anywhere. Bodies have inertia, sensors sit beside
the line in housings that are askew, place and length are not what was measured, sensors have offsets, scale errors and coarse
steps, the motion is damped by air and by dry friction.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np

from gateway.pipeline.rig import UNCALIBRATED, Rig
from gateway.swing.estimate import SwingEstimate
from gateway.swing.offline import estimate_swing
from tests.blind.rigid_pendulum import GRAVITY_M_S2, RigidPendulum, simulate

CASES, SEED = 60, 16
LARGEST_TILT_DEG = 85.0
WIDE_DEG = (60.0, 145.0)


@dataclass(frozen=True)
class Case:
    """A recording, what the rig says of it, and what is true."""

    name: str
    time_s: np.ndarray
    force_g: np.ndarray
    rig: Rig
    phi_max_deg: float


def draw(rng: np.random.Generator, number: int, *, is_wide: bool = False) -> Case:
    """Return a recording drawn by chance."""
    is_short = is_wide or number % 2 == 0
    line_m = float(rng.uniform(0.15, 0.8) if is_short else rng.uniform(2, 15))
    rho = float(rng.uniform(0.85, 1.02) if is_short else rng.choice([0.1, 0.5, 0.8, 0.95, 1.0]))
    tilt_deg = float(np.exp(rng.uniform(np.log(5 if is_short else 2), np.log(LARGEST_TILT_DEG if is_short else 30))))
    if is_wide:
        rho, tilt_deg = float(rng.choice([0.0, rng.uniform(0, 1.02)])), float(rng.uniform(*WIDE_DEG))
    beside_m = rng.uniform(0, 0.03)
    turn = rng.uniform(0, 2 * np.pi)
    body = RigidPendulum(
        line_m=line_m,
        bob_radius_m=float(rng.uniform(0, 0.15 * line_m)) if is_short else float(rng.uniform(0, 0.5)),
        rod_mass_ratio=float(rng.choice([0, rng.uniform(0, 0.5)])),
        sensor_m=rho * line_m,
        beside_m=(float(beside_m * np.cos(turn)), float(beside_m * np.sin(turn))),
        damping_ratio=float(np.exp(rng.uniform(np.log(3e-4), np.log(6e-3)))),
        drag=float(rng.choice([0, rng.uniform(0, 0.05)])),
        friction=float(rng.choice([0, rng.uniform(0, 0.004)])),
        wind=(0.0, 0.0) if is_short or rng.random() < 0.5 else tuple(rng.normal(0, 0.02, 2).tolist()),
    )
    period_s = 2 * np.pi * np.sqrt(body.equivalent_m / GRAVITY_M_S2)
    duration_s = float(rng.uniform(8, 30)) * period_s
    across = 0.0 if rng.random() < 0.6 else float(rng.uniform(-0.5, 0.5)) * np.radians(tilt_deg) * 2 * np.pi / period_s
    motion = simulate(body, np.radians(tilt_deg), float(rng.uniform(0, 2 * np.pi)), across, duration_s)
    rate_hz = float(rng.choice([10, 20, 50, 100, 200])) if period_s > 0.9 else float(rng.choice([20, 50, 100, 200]))
    step_mg, noise_mg = float(np.exp(rng.uniform(np.log(0.1), np.log(16)))), float(rng.uniform(0.3, 4))
    mount_deg = float(rng.uniform(0, 20)) if rng.random() < 0.6 else float(rng.uniform(0, 3))
    time_s = np.arange(0, motion.time_s[-1], 1 / rate_hz)
    force_g = np.stack([np.interp(time_s, motion.time_s, motion.force_g[:, axis]) for axis in range(3)], axis=1)
    force_g = force_g @ _mount(np.radians(mount_deg), rng.uniform(0, 2 * np.pi)).T
    force_g = (
        force_g * (1 + rng.normal(0, 0.01, 3))
        + rng.normal(0, 0.02, 3)
        + 1e-3 * noise_mg * rng.normal(size=force_g.shape)
    )
    force_g = 1e-3 * step_mg * np.round(force_g / (1e-3 * step_mg))
    place_error = float(rng.uniform(-0.07, 0.07)) if is_short else float(rng.uniform(-0.02, 0.02))
    rig = Rig.model_validate(
        {
            "rope": {"length_m": line_m * float(rng.uniform(0.85, 1.2))},
            "housing": {"position_m": body.sensor_m * (1 + place_error)},
            "sensor": {"sample_rate_hz": rate_hz},
        }
    )
    name = (
        f"{number:3d} L={line_m:5.2f} rho={rho:.2f} tilt={tilt_deg:4.1f} mount={mount_deg:4.1f} beside={100 * beside_m:3.1f}cm "
        f"place={100 * place_error:+4.1f}% {rate_hz:3.0f}Hz step={step_mg:4.1f}mg T/dt={period_s * rate_hz:4.0f} "
        f"fric={1e3 * body.friction:3.1f} drag={body.drag:.3f} Leq/L={body.equivalent_m / line_m:.3f}"
    )
    inside = motion.time_s <= time_s[-1]
    return Case(name, time_s, force_g, rig, float(np.degrees(motion.angle_rad[inside].max())))


def _mount(angle_rad: float, azimuth_rad: float) -> np.ndarray:
    """Return R_sensor_from_line of a housing askew by an angle about a horizontal axis."""
    axis = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    cross = np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross)


def main() -> None:
    """Print a line for each case, then answered share, coverage, and width and error of the intervals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="?", type=int, default=CASES)
    parser.add_argument("seed", nargs="?", type=int, default=SEED)
    parser.add_argument("--wide", action="store_true")
    chosen = parser.parse_args()
    rng = np.random.default_rng(chosen.seed)
    rows = []
    for number in range(chosen.cases):
        case = draw(rng, number, is_wide=chosen.wide)
        start_s = time.process_time()
        estimate = estimate_swing(case.time_s, case.force_g, rig=case.rig.mounted_housing(UNCALIBRATED))
        rows.append((case, estimate, time.process_time() - start_s))
        print(_line(*rows[-1]), flush=True)
    parts = [] if chosen.wide else [("short", rows[::2]), ("rope", rows[1::2])]
    for name, part in (*parts, ("all", rows)):
        print(name, _summary(part))


def _line(case: Case, estimate: SwingEstimate, cpu_s: float) -> str:
    if estimate.coverage95_rad is None or estimate.phi_max_rad is None:
        return f"{case.name}: UNKNOWN true {case.phi_max_deg:.2f} {'; '.join(estimate.reasons)} {cpu_s:.1f} s"
    low, high = np.degrees(estimate.coverage95_rad)
    verdict = "ok  " if low <= case.phi_max_deg <= high else "MISS"
    answer = f"true {case.phi_max_deg:.2f} said {np.degrees(estimate.phi_max_rad):.2f} ({low:.2f} to {high:.2f})"
    return f"{case.name}: {verdict} {answer} {cpu_s:.1f} s {'; '.join(estimate.reasons)}"


def _summary(rows: list[tuple[Case, SwingEstimate, float]]) -> str:
    known = [
        (np.degrees(estimate.coverage95_rad), np.degrees(estimate.phi_max_rad), case.phi_max_deg)
        for case, estimate, _ in rows
        if estimate.coverage95_rad is not None and estimate.phi_max_rad is not None
    ]
    if not known:
        return f"{len(rows)} cases, none answered"
    interval, angle, true = (np.array(column) for column in zip(*known, strict=True))
    right = (interval[:, 0] <= true) & (true <= interval[:, 1])
    width, error = (interval[:, 1] - interval[:, 0]) / 2 / true, np.abs(angle - true) / true
    return (
        f"{len(rows)} cases, answered {len(known) / len(rows):.0%}, right {right.mean():.0%}; "
        f"half width {np.median(width):.1%} median, {np.quantile(width, 0.9):.1%} p90; "
        f"error {np.median(error):.1%} median, {np.quantile(error, 0.9):.1%} p90; "
        f"CPU {np.median([cpu for *_, cpu in rows]):.2f} s median, {max(cpu for *_, cpu in rows):.1f} s max"
    )


if __name__ == "__main__":
    main()
