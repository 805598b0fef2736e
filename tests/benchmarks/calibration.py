"""Calibration: coverage of the stated intervals, tilt errors by placement, and the time of a fit."""

from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.methods.norm_fit import fit_norm
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.pose import NominalSensitivity, Pose, find_face
from gateway.calibration.pose_procedure import make_procedure
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.calibration_sessions import (
    ADXL345,
    ADXL355,
    Part,
    SensorErrors,
    draw_errors,
    misplaced_faces,
    place_faces,
    requested_poses,
    specific_force,
    split_blocks,
    to_counts,
    unit,
)

SESSIONS = 1000
PLACEMENT_DEG = 0.1
MEAN_U_G = ADXL355.noise_g[0] / 300**0.5
NAMES = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz", "offset x", "offset y", "offset z")


def session_fit(method: str, part: Part, errors: SensorErrors, random: np.random.Generator) -> CalibrationFit:
    """Return the fit of one session from its counts. The norm fit is compared in its own frame."""
    poses = place_faces(random, PLACEMENT_DEG) if method == "six-position" else requested_poses(random)
    procedure = make_procedure(
        method, NominalSensitivity(part.units_per_g), placement_u_deg=PLACEMENT_DEG, frame_u_deg=0.0
    )
    for readings in split_blocks(to_counts(random, part, errors, specific_force(random, poses))):
        procedure.feed(readings)
    return procedure.finish()


def is_covered(fit: CalibrationFit, matrix: Array, offset: Array) -> NDArray[np.bool_]:
    """Return which of the twelve parameters are within their 95 % interval, shape (12,)."""
    error = np.concatenate([(fit.correction_matrix - matrix).ravel(), np.array(fit.offset) - offset])
    return np.asarray(np.abs(error) <= NORMAL_975 * np.sqrt(np.diag(fit.covariance)))


def coverage(method: str, part: Part, sessions: int, seed: int = 1) -> Array:
    """Return the share of sessions in which each parameter is within its interval, shape (12,)."""
    hits = np.zeros(12)
    for number in range(sessions):
        random = np.random.default_rng([seed, number])
        errors = draw_errors(random)
        fit = session_fit(method, part, errors, random)
        matrix = errors.matrix(part) if method == "six-position" else errors.symmetric_matrix(part)
        hits += is_covered(fit, matrix, errors.offset_g * part.units_per_g)
    return hits / sessions


def relative_tilt_errors_deg(method: str, placement_deg: float, sessions: int, seed: int = 2) -> Array:
    """Return the largest error of the angle between hanging rest and a tilt of up to 20 degrees by session, shape (sessions,).

    The sensor has the injected errors and 300 readings of an ADXL355 in each mean; the six faces are off by exactly this angle.
    """
    found = np.empty(sessions)
    for number in range(sessions):
        random = np.random.default_rng([seed, number])
        errors = draw_errors(random)
        poses = misplaced_faces(random, placement_deg) if method == "six-position" else requested_poses(random)
        taken = tuple(_pose(up, errors, method, random) for up in poses)
        fit = fit_six_positions(taken, placement_deg) if method == "six-position" else fit_norm(taken, 1.0)
        found[number] = _relative_error_deg(fit, errors)
    return found


def _pose(up: Array, errors: SensorErrors, method: str, random: np.random.Generator) -> Pose:
    x, y, z = (errors.gain @ up + errors.offset_g + MEAN_U_G * random.standard_normal(3)).tolist()
    face = find_face(up) if method == "six-position" else None
    return Pose((x, y, z), (MEAN_U_G, MEAN_U_G, MEAN_U_G), 300, face, noise=ADXL355.noise_g)


def _relative_error_deg(fit: CalibrationFit, errors: SensorErrors) -> float:
    tilt, azimuth = (
        grid.ravel() for grid in np.meshgrid(np.radians([5.0, 10.0, 15.0, 20.0]), np.radians(range(0, 360, 15)))
    )
    up = np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    both = np.vstack([[0, 0, 1], up]) @ errors.gain.T + errors.offset_g
    corrected = unit((both - fit.offset) @ fit.correction_matrix.T)
    measured = np.arccos(np.clip(corrected[1:] @ corrected[0], -1, 1))
    return float(np.degrees(np.max(np.abs(measured - tilt))))


def fit_times_ms(method: str, repeats: int = 300) -> Array:
    """Return the durations of a fit of given poses, ms."""
    random = np.random.default_rng(3)
    errors = draw_errors(random)
    poses = place_faces(random, 0.1) if method == "six-position" else requested_poses(random)
    taken = tuple(_pose(up, errors, method, random) for up in poses)
    times = np.empty(repeats)
    for number in range(repeats):
        start = perf_counter()
        _ = fit_six_positions(taken) if method == "six-position" else fit_norm(taken, 1.0)
        times[number] = (perf_counter() - start) * 1e3
    return times


def main() -> None:
    """Print coverage, tilt errors and durations."""
    print(f"injected errors within their 95 % intervals, {SESSIONS} sessions each")
    for method in ("six-position", "norm-fit"):
        for part in (ADXL345, ADXL355):
            share = coverage(method, part, SESSIONS)
            print(
                f"  {method:12} {part.name}: {share.mean():.3f} of all, {share.min():.3f} to {share.max():.3f} by parameter"
            )
            print("    " + ", ".join(f"{name} {value:.3f}" for name, value in zip(NAMES, share, strict=True)))
    print("relative tilt from hanging rest, largest error up to 20 deg, 100 sessions")
    for placement_deg in (0.1, 0.3, 1.0):
        for method in ("six-position", "norm-fit"):
            found = relative_tilt_errors_deg(method, placement_deg, 100)
            low, high = np.quantile(found, [0.1, 0.9])
            print(
                f"  placement {placement_deg} deg, {method:12}: median {np.median(found):.5f}, 80 % {low:.5f} to {high:.5f} deg"
            )
    for method in ("six-position", "norm-fit"):
        times = fit_times_ms(method)
        print(
            f"  fit, {method:12}: median {np.median(times):.2f} ms, 95th percentile {np.quantile(times, 0.95):.2f} ms"
        )
