"""The pose finder: which poses are taken or refused, independent of the blocks in which readings arrive."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from gateway.calibration.pose import (
    FACE_DIRECTIONS,
    Face,
    NominalSensitivity,
    RawReadings,
    correlation_factor,
    quantisation_u,
)
from gateway.calibration.pose_finder import READINGS_PER_POSE, PoseFinder
from gateway.calibration.pose_procedure import PoseProcedure, make_procedure
from gateway.calibration.record import CalibrationError
from gateway.numerics.array import Array
from tests.benchmarks.calibration_sessions import (
    ADXL345,
    RATE_HZ,
    draw_errors,
    place_faces,
    requested_poses,
    specific_force,
    split_blocks,
    to_counts,
)

NOMINAL = NominalSensitivity(1.0)
NOISE_G = 0.002


def make_readings(force_g: Array, start_s: float = 0.0, noise_g: float = NOISE_G, seed: int = 0) -> RawReadings:
    random = np.random.default_rng(seed)
    time_s = start_s + np.arange(len(force_g)) / RATE_HZ
    return RawReadings(time_s, force_g + noise_g * random.standard_normal((len(force_g), 3)))


def resting(face: Face, seconds: float) -> Array:
    """Return the specific force of a rest on a face, g, shape (n, 3)."""
    return np.tile(FACE_DIRECTIONS[face], (round(seconds * RATE_HZ), 1))


def turning(seconds: float = 0.8, seed: int = 1) -> Array:
    """Return the specific force of a turn by hand, g, shape (n, 3)."""
    return np.random.default_rng(seed).normal(0, 0.5, (round(seconds * RATE_HZ), 3)) + FACE_DIRECTIONS["+z"]


def rest_on_faces(faces: Sequence[Face], rest_s: float = 4.0) -> Array:
    """Return the specific force of rests on faces, with turns between them, g, shape (n, 3)."""
    return np.vstack([part for face in faces for part in (turning(), resting(face, rest_s))])


def feed(method: str, readings: RawReadings) -> PoseProcedure:
    """Return the procedure of a method after these readings."""
    procedure = make_procedure(method, NOMINAL)
    procedure.feed(readings)
    return procedure


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 7, 32, 333, 100_000])
@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_the_fit_does_not_depend_on_the_blocks(method: str, size: int) -> None:
    random = np.random.default_rng(3)
    errors = draw_errors(random)
    poses = place_faces(random, 0.1) if method == "six-position" else requested_poses(random)
    counts = to_counts(random, ADXL345, errors, specific_force(random, poses))

    def fit(block: int) -> dict[str, Any]:
        procedure = make_procedure(method, NominalSensitivity(ADXL345.units_per_g))
        for part in split_blocks(counts, block, temperature_c=21.5):
            procedure.feed(part)
        found = asdict(procedure.finish())
        return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in found.items()}

    assert fit(size) == fit(64)


def test_faces_are_found_in_any_order() -> None:
    order: list[Face] = ["-y", "+z", "+x", "-x", "+y", "-z"]
    procedure = feed("six-position", make_readings(rest_on_faces(order)))
    progress = procedure.progress()
    assert [pose.face for pose in progress.poses] == order
    assert progress.complete
    assert all(pose.count >= READINGS_PER_POSE for pose in progress.poses)


def test_a_face_that_is_laid_down_after_a_tilted_pose_is_taken_and_the_tilted_one_is_not_used() -> None:
    tilt = np.radians(12.0)
    tilted = np.tile([np.cos(tilt), np.sin(tilt), 0.0], (400, 1))
    others = rest_on_faces(["-x", "+y", "-y", "+z", "-z"])
    fit = feed("six-position", make_readings(np.vstack([tilted, resting("+x", 4.0), others]), noise_g=1e-4)).finish()
    assert [(pose.face, pose.used) for pose in fit.poses[:2]] == [(None, False), ("+x", True)]
    np.testing.assert_allclose(fit.correction_matrix, np.eye(3), atol=1e-4)


def test_a_missing_face_is_requested() -> None:
    progress = feed("six-position", make_readings(rest_on_faces(["+x", "-x", "+y"]))).progress()
    assert not progress.complete
    assert progress.next_face == "-y"
    assert progress.next_direction == (0.0, -1.0, 0.0)
    assert "next: -y up; missing: -y, +z, -z" in progress.text


def test_progress_increases_while_a_pose_is_taken() -> None:
    finder = PoseFinder(NOMINAL)
    finder.feed(make_readings(np.vstack([turning(), resting("+z", 2.0)])))
    assert finder.still
    assert 0.3 < finder.fraction < 0.7
    assert finder.seconds_left == pytest.approx(3.0 - 2.0 + 0.5, abs=0.6)


def test_a_rest_that_ends_too_early_is_not_taken() -> None:
    finder = PoseFinder(NOMINAL)
    found = finder.feed(make_readings(np.vstack([turning(), resting("+z", 1.0), turning()])))
    assert found == []
    assert not finder.still
    assert "not taken" in finder.text


def test_a_rest_that_ends_early_is_kept_if_its_mean_is_good_enough() -> None:
    (pose,) = PoseFinder(NOMINAL).feed(make_readings(np.vstack([turning(), resting("+z", 2.5), turning()])))
    assert pose.count < READINGS_PER_POSE
    assert max(pose.type_a) < 5e-4


def test_a_quiet_sensor_needs_fewer_readings() -> None:
    finder = PoseFinder(NOMINAL)
    (pose,) = finder.feed(make_readings(np.vstack([turning(), resting("+z", 1.9)]), noise_g=1e-4))
    assert pose.count < READINGS_PER_POSE / 2


def test_a_long_rest_is_one_pose() -> None:
    assert len(PoseFinder(NOMINAL).feed(make_readings(np.vstack([turning(), resting("+z", 30.0)])))) == 1


def test_a_nudge_does_not_start_another_pose() -> None:
    nudged = resting("+z", 5.0) + 0.01 * FACE_DIRECTIONS["+x"]
    stream = np.vstack([turning(), resting("+z", 5.0), nudged])
    assert len(PoseFinder(NOMINAL).feed(make_readings(stream))) == 1


def test_a_rest_without_a_turn_counts_as_a_rest_and_is_no_pose() -> None:
    finder = PoseFinder(NOMINAL)
    shake = np.array([0.05, 0, 0])
    nudge = np.vstack([resting("+z", 4.0), resting("+z", 0.5) + shake, resting("+z", 0.5) - shake])
    stream = np.vstack([turning(), nudge, resting("+z", 30.0), turning(), resting("-z", 0.5), turning()])

    assert (len(finder.feed(make_readings(stream))), finder.rests) == (1, 2)


def test_the_same_face_again_is_a_repeat() -> None:
    procedure = feed("six-position", make_readings(rest_on_faces(["+x", "-x", "+x"])))
    assert [pose.face for pose in procedure.progress().poses] == ["+x", "-x", "+x"]
    assert "+x taken again: 2 are averaged" in procedure.progress().text


def test_a_pose_near_an_earlier_one_counts_for_a_norm_fit_but_not_as_one_that_it_asks_for() -> None:
    procedure = feed("norm-fit", make_readings(rest_on_faces(["+x", "-x", "+x"])))
    once = feed("norm-fit", make_readings(rest_on_faces(["+x", "-x"])))
    assert len(procedure.progress().poses) == 3
    assert "pose 3 taken, near pose 1: it adds little" in procedure.progress().text
    assert procedure.progress().text.endswith(once.progress().text.split("; ")[-1])


def test_a_pose_between_faces_is_not_used_for_six_positions() -> None:
    slanting = np.tile([0.0, np.sin(0.6), np.cos(0.6)], (400, 1))
    procedure = feed("six-position", make_readings(np.vstack([turning(), slanting])))
    (pose,) = procedure.progress().poses
    assert (pose.face, pose.used) == (None, False)
    assert "34 deg off the nearest face: not used" in procedure.progress().text


def test_a_reading_of_the_wrong_magnitude_is_refused() -> None:
    finder = PoseFinder(NOMINAL)
    assert finder.feed(make_readings(np.vstack([turning(), 1.5 * resting("+z", 5.0)]))) == []
    assert "reads 1.50 g at rest" in finder.text


def test_a_slow_swing_is_no_rest() -> None:
    swing = np.radians(8) * np.sin(2 * np.pi * 0.3 * np.arange(1500) / RATE_HZ)
    force = np.column_stack([np.sin(swing), np.zeros(1500), np.cos(swing)])
    for pose in PoseFinder(NOMINAL).feed(make_readings(force)):
        pytest.fail(f"taken while swinging: {pose}")


def test_a_gap_in_the_readings_ends_a_pose() -> None:
    finder = PoseFinder(NOMINAL)
    assert finder.feed(make_readings(resting("+z", 1.0))) == []
    assert finder.feed(make_readings(resting("+z", 1.0), start_s=60.0)) == []


def test_correlated_noise_enlarges_the_uncertainty() -> None:
    random = np.random.default_rng(9)
    slow = np.repeat(random.normal(0, 0.002, (10, 3)), 50, axis=0)  # constant for half a second each
    white = make_readings(resting("+z", 5.0), noise_g=0.002).raw[:500]
    means = (slow + white).reshape(20, 25, 3).mean(axis=1)
    sigma = np.full(3, 0.002)
    assert correlation_factor(means, np.full(20, 25.0), sigma) > 3
    assert correlation_factor(white.reshape(20, 25, 3).mean(axis=1), np.full(20, 25.0), sigma) == 1.0


def test_quantisation_is_rectangular_without_noise_and_dithered_by_noise() -> None:
    assert quantisation_u(1.0, np.zeros(3)) == pytest.approx(1 / np.sqrt(12))
    assert np.max(quantisation_u(1.0, np.ones(3))) < 1e-6
    assert quantisation_u(0.0, np.zeros(3)) == pytest.approx(0)


def test_a_resumed_procedure_continues_where_it_was() -> None:
    stream = make_readings(rest_on_faces(["+x", "-x", "+y", "-y", "+z", "-z"]))
    whole = feed("six-position", stream)
    half = int(np.searchsorted(stream.time_s, 3 * 4.8))
    before = feed("six-position", RawReadings(stream.time_s[:half], stream.raw[:half]))
    after = make_procedure("six-position", NOMINAL)
    after.resume(before.progress().poses)
    after.feed(RawReadings(stream.time_s[half:], stream.raw[half:]))
    assert [pose.face for pose in after.progress().poses] == [pose.face for pose in whole.progress().poses]
    assert after.progress().complete


def test_an_unknown_method_is_refused() -> None:
    with pytest.raises(CalibrationError, match="no method laser; there are six-position, norm-fit"):
        make_procedure("laser", NOMINAL)


def test_a_first_pose_held_by_hand_is_removed_once_the_noise_is_known() -> None:
    """A tremor of 15 mg counts as stillness until the sensor's own noise of 0.2 mg has shown."""
    time_s = np.arange(500) / RATE_HZ
    held = resting("+x", 5.0)
    held[:, 1] += 0.02 * np.sin(2 * np.pi * 7 * time_s)
    procedure = make_procedure("six-position", NOMINAL)
    stream = make_readings(np.vstack([turning(3.0), held, rest_on_faces(["-x", "+y", "-y"])]), noise_g=2e-4)
    first = int(np.searchsorted(stream.time_s, 8.0))
    procedure.feed(RawReadings(stream.time_s[:first], stream.raw[:first]))
    assert [pose.face for pose in procedure.progress().poses] == ["+x"]
    procedure.feed(RawReadings(stream.time_s[first:], stream.raw[first:]))
    assert [pose.face for pose in procedure.progress().poses] == ["-x", "+y", "-y"]
    assert procedure.progress().next_face == "+x"
