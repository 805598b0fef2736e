"""The pose finder: what is taken, what is refused, and that blocks do not matter."""

from dataclasses import asdict

import numpy as np
import pytest

from gateway.calibration.poses.faces import FACE_DIRECTIONS
from gateway.calibration.poses.mean_uncertainty import correlation_factor, quantisation_u
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.poses.pose_finder import READINGS, NominalSensitivity, PoseFinder
from gateway.calibration.procedures.procedure_factory import procedure_for
from gateway.calibration.record import CalibrationError
from tests.benchmarks.calibration_sessions import (
    ADXL345,
    RATE_HZ,
    all_round,
    blocks,
    counts_of,
    force_of,
    laid_faces,
    planted,
)

NOMINAL = NominalSensitivity(1.0)
NOISE_G = 0.002


def readings(force_g, start_s=0.0, noise_g=NOISE_G, seed=0):
    random = np.random.default_rng(seed)
    time_s = start_s + np.arange(len(force_g)) / RATE_HZ
    return RawReadings(time_s, force_g + noise_g * random.standard_normal((len(force_g), 3)))


def resting(face, seconds):
    return np.tile(FACE_DIRECTIONS[face], (round(seconds * RATE_HZ), 1))


def turning(seconds=0.8, seed=1):
    return np.random.default_rng(seed).normal(0, 0.5, (round(seconds * RATE_HZ), 3)) + FACE_DIRECTIONS["+z"]


def six_faces(faces, rest_s=4.0):
    return np.vstack([part for face in faces for part in (turning(), resting(face, rest_s))])


def fed(procedure, stream):
    procedure.feed(stream)
    return procedure


@pytest.mark.parametrize("size", [1, 7, 32, 333, 100_000])
@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_the_fit_does_not_hang_on_the_blocks(method, size):
    random = np.random.default_rng(3)
    errors = planted(random)
    poses = laid_faces(random, 0.1) if method == "six-position" else all_round(random)
    counts = counts_of(random, ADXL345, errors, force_of(random, poses))

    def fit(block):
        procedure = procedure_for(method, NominalSensitivity(ADXL345.units_per_g))
        for part in blocks(counts, block, temperature_c=21.5):
            procedure.feed(part)
        found = asdict(procedure.finish())
        return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in found.items()}

    assert fit(size) == fit(64)


def test_faces_are_found_in_any_order():
    order = ["-y", "+z", "+x", "-x", "+y", "-z"]
    procedure = fed(procedure_for("six-position", NOMINAL), readings(six_faces(order)))
    progress = procedure.progress()
    assert [pose.face for pose in progress.poses] == order
    assert progress.complete
    assert all(pose.count >= READINGS for pose in progress.poses)


def test_a_missing_face_is_asked_for():
    progress = fed(procedure_for("six-position", NOMINAL), readings(six_faces(["+x", "-x", "+y"]))).progress()
    assert not progress.complete
    assert progress.next_face == "-y"
    assert progress.next_direction == (0, -1, 0)
    assert "next: -y up; missing: -y, +z, -z" in progress.text


def test_progress_counts_up_while_a_pose_is_taken():
    finder = PoseFinder(NOMINAL)
    finder.feed(readings(np.vstack([turning(), resting("+z", 2.0)])))
    assert finder.still
    assert 0.3 < finder.fraction < 0.7
    assert finder.seconds_left == pytest.approx(3.0 - 2.0 + 0.5, abs=0.6)


def test_moving_too_soon_takes_nothing_and_says_so():
    finder = PoseFinder(NOMINAL)
    found = finder.feed(readings(np.vstack([turning(), resting("+z", 1.0), turning()])))
    assert found == []
    assert not finder.still
    assert "not taken" in finder.text


def test_a_pose_that_was_cut_short_is_kept_when_it_is_good_enough():
    (pose,) = PoseFinder(NOMINAL).feed(readings(np.vstack([turning(), resting("+z", 2.5), turning()])))
    assert pose.count < READINGS
    assert max(pose.type_a) < 5e-4


def test_a_quiet_sensor_is_done_sooner():
    finder = PoseFinder(NOMINAL)
    (pose,) = finder.feed(readings(np.vstack([turning(), resting("+z", 1.9)]), noise_g=1e-4))
    assert pose.count < READINGS / 2


def test_lying_on_is_one_pose():
    assert len(PoseFinder(NOMINAL).feed(readings(np.vstack([turning(), resting("+z", 30.0)])))) == 1


def test_a_nudge_is_no_repeat():
    nudged = resting("+z", 5.0) + 0.01 * FACE_DIRECTIONS["+x"]
    stream = np.vstack([turning(), resting("+z", 5.0), nudged])
    assert len(PoseFinder(NOMINAL).feed(readings(stream))) == 1


def test_the_same_face_again_is_a_repeat():
    procedure = fed(procedure_for("six-position", NOMINAL), readings(six_faces(["+x", "-x", "+x"])))
    assert [pose.face for pose in procedure.progress().poses] == ["+x", "-x", "+x"]
    assert "+x taken again: 2 are averaged" in procedure.progress().text


def test_norm_fit_refuses_a_pose_too_near_an_earlier_one():
    procedure = fed(procedure_for("norm-fit", NOMINAL), readings(six_faces(["+x", "-x", "+x"])))
    assert len(procedure.progress().poses) == 2
    assert "too near pose 1: adds nothing" in procedure.progress().text


def test_a_pose_between_faces_is_not_used_for_six_positions():
    slanting = np.tile([0.0, np.sin(0.6), np.cos(0.6)], (400, 1))
    procedure = fed(procedure_for("six-position", NOMINAL), readings(np.vstack([turning(), slanting])))
    (pose,) = procedure.progress().poses
    assert (pose.face, pose.used) == (None, False)
    assert "34 deg off the nearest face: not used" in procedure.progress().text


def test_a_reading_of_the_wrong_size_is_refused():
    finder = PoseFinder(NOMINAL)
    assert finder.feed(readings(np.vstack([turning(), 1.5 * resting("+z", 5.0)]))) == []
    assert "reads 1.50 g at rest" in finder.text


def test_slow_swaying_is_no_rest():
    sway = np.radians(8) * np.sin(2 * np.pi * 0.3 * np.arange(1500) / RATE_HZ)
    force = np.column_stack([np.sin(sway), np.zeros(1500), np.cos(sway)])
    for pose in PoseFinder(NOMINAL).feed(readings(force)):
        pytest.fail(f"taken while swaying: {pose}")


def test_a_gap_in_the_readings_ends_a_pose():
    finder = PoseFinder(NOMINAL)
    assert finder.feed(readings(resting("+z", 1.0))) == []
    assert finder.feed(readings(resting("+z", 1.0), start_s=60.0)) == []


def test_correlated_noise_widens_the_uncertainty():
    random = np.random.default_rng(9)
    slow = np.repeat(random.normal(0, 0.002, (10, 3)), 50, axis=0)  # wanders from half second to half second
    white = readings(resting("+z", 5.0), noise_g=0.002).raw[:500]
    means = (slow + white).reshape(20, 25, 3).mean(axis=1)
    sigma = np.full(3, 0.002)
    assert correlation_factor(means, np.full(20, 25.0), sigma) > 3
    assert correlation_factor(white.reshape(20, 25, 3).mean(axis=1), np.full(20, 25.0), sigma) == 1.0


def test_quantisation_without_noise_is_rectangular_and_dithered_away_by_noise():
    assert quantisation_u(1.0, np.zeros(3)) == pytest.approx(1 / np.sqrt(12))
    assert np.max(quantisation_u(1.0, np.ones(3))) < 1e-6
    assert quantisation_u(0.0, np.zeros(3)) == pytest.approx(0)


def test_resuming_goes_on_where_it_was():
    stream = readings(six_faces(["+x", "-x", "+y", "-y", "+z", "-z"]))
    whole = fed(procedure_for("six-position", NOMINAL), stream)
    half = int(np.searchsorted(stream.time_s, 3 * 4.8))
    before = fed(procedure_for("six-position", NOMINAL), RawReadings(stream.time_s[:half], stream.raw[:half]))
    after = procedure_for("six-position", NOMINAL)
    after.resume(before.progress().poses)
    after.feed(RawReadings(stream.time_s[half:], stream.raw[half:]))
    assert [pose.face for pose in after.progress().poses] == [pose.face for pose in whole.progress().poses]
    assert after.progress().complete


def test_an_unknown_method_is_refused():
    with pytest.raises(CalibrationError, match="no method laser; there are six-position, norm-fit"):
        procedure_for("laser", NOMINAL)


def test_a_first_pose_held_by_hand_is_taken_out_once_the_noise_is_known():
    """A tremor of 15 mg passes while nothing quieter was seen; the sensor's own noise is 0.2 mg."""
    time_s = np.arange(500) / RATE_HZ
    held = resting("+x", 5.0)
    held[:, 1] += 0.02 * np.sin(2 * np.pi * 7 * time_s)
    procedure = procedure_for("six-position", NOMINAL)
    stream = readings(np.vstack([turning(3.0), held, six_faces(["-x", "+y", "-y"])]), noise_g=2e-4)
    first = int(np.searchsorted(stream.time_s, 8.0))
    procedure.feed(RawReadings(stream.time_s[:first], stream.raw[:first]))
    assert [pose.face for pose in procedure.progress().poses] == ["+x"]
    procedure.feed(RawReadings(stream.time_s[first:], stream.raw[first:]))
    assert [pose.face for pose in procedure.progress().poses] == ["-x", "+y", "-y"]
    assert procedure.progress().next_face == "+x"
