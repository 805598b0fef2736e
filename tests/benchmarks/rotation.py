"""Rotation calibration: coverage of the stated intervals."""

import numpy as np

from gateway.bench.rotation import fit_rotation
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.rotation_turns import Rig, draw_sensor, turn
from tests.values import present

SESSIONS = 400
RIGS = {
    f"{angles} angles, {name}": Rig(angles=angles, angle_deg=angle_deg, noise_g=noise_g)
    for angles in (12, 36, 72)
    for name, angle_deg, noise_g in (
        ("rig 0.02 deg, noise 0.05 mg", 0.02, 5e-5),
        ("rig exact, noise 0.5 mg", 0.0, 5e-4),
    )
}


def coverage(rig: Rig, sessions: int) -> Array:
    """Return the share of sessions in which each of the twelve parameters is within its 95 % interval, shape (12,)."""
    hits = []
    for seed in range(sessions):
        random = np.random.default_rng(seed)
        sensitivity, offset = sensor = draw_sensor(random)
        turns = (turn(random, sensor, 1, rig), turn(random, sensor, 0, rig))
        fit = present(fit_rotation(turns, rig.mounting_deg).calibration)
        error = np.concatenate([(fit.correction_matrix - np.linalg.inv(sensitivity)).ravel(), fit.offset - offset])
        hits.append(np.abs(error) <= NORMAL_975 * np.sqrt(np.diag(fit.covariance)))
    return np.asarray(np.mean(hits, axis=0))


def main() -> None:
    """Print the table of docs/evidence/bench_methods.md."""
    print(f"within the stated 95 % interval, {SESSIONS} sessions: all (least to most of the twelve parameters)")
    for name, rig in RIGS.items():
        share = coverage(rig, SESSIONS)
        print(f"  {name:40} {share.mean():.1%} ({share.min():.1%} to {share.max():.1%})")
