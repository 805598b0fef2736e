"""The simulated part: planted errors come back from static data, and the factory record is as good as it says."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.accelerometer import (
    MAX_COUNT,
    Accelerometer,
    Ambient,
    factory_calibration,
    no_errors,
    typical_errors,
)


def test_a_perfect_part_reads_its_sensitivity() -> None:
    part = Accelerometer(no_errors(), odr_hz=1e-9)  # so slow that it has no noise
    force_g = np.array([[0.0, 0.0, 1.0], [-0.5, 0.25, 0.125]])
    counts = part.counts(force_g, np.full(2, 25.0), np.random.default_rng(0))
    assert counts.dtype == np.int32
    assert counts.tolist() == [[0, 0, 256000], [-128000, 64000, 32000]]


def test_range_halves_the_sensitivity_and_doubles_the_full_scale() -> None:
    two, four = Accelerometer(no_errors(), 125.0, 2.0), Accelerometer(no_errors(), 125.0, 4.0)
    assert (two.units_per_g, four.units_per_g) == (256000, 128000)
    assert four.full_scale_g == 2 * two.full_scale_g == pytest.approx(4.096, abs=1e-4)


def test_beyond_full_scale_every_reading_is_at_or_beyond_the_stated_limit() -> None:
    part = Accelerometer(no_errors(), odr_hz=125.0)
    counts = part.counts(np.array([[3.0, -3.0, 2.0]]), np.array([25.0]), np.random.default_rng(0))
    assert counts[0, :2].tolist() == [MAX_COUNT, -MAX_COUNT - 1]
    clipped = np.abs(counts) / part.units_per_g >= part.full_scale_g
    assert clipped.tolist() == [[True, True, False]]


def test_noise_is_white_and_of_the_stated_size() -> None:
    part = Accelerometer(no_errors(), odr_hz=1000.0)
    assert part.noise_g == pytest.approx(0.56e-3, rel=0.01)
    still = np.tile([0.0, 0.0, 1.0], (20_000, 1))
    noise_g = part.counts(still, np.full(20_000, 25.0), np.random.default_rng(1)) / part.units_per_g - still
    assert noise_g.std(axis=0) == pytest.approx(np.full(3, part.noise_g), rel=0.03)
    neighbours = np.einsum("ni,ni->i", noise_g[1:], noise_g[:-1]) / len(noise_g) / part.noise_g**2
    assert np.abs(neighbours).max() < 4 / np.sqrt(20_000)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_planted_errors_come_back_from_poses(seed: int) -> None:
    random = np.random.default_rng(seed)
    part = Accelerometer(typical_errors(random, 22.0), odr_hz=125.0)
    poses = random.standard_normal((30, 3))
    poses /= np.linalg.norm(poses, axis=1)[:, None]
    count = 1000
    means = [part.counts(np.tile(p, (count, 1)), np.full(count, 22.0), random).mean(axis=0) for p in poses]
    design = np.column_stack([poses, np.ones(len(poses))])
    found = np.linalg.lstsq(design, np.array(means) / part.units_per_g, rcond=None)[0]
    u = part.noise_g / np.sqrt(count) * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    planted = np.column_stack([part.errors.gain, part.errors.zero_g_offset_g]).T
    assert np.abs((found - planted) / u[:, None]).max() < 4.5
    assert np.abs(planted - np.eye(4, 3)).max() > 20 * u.max()  # so that the lines above can fail


def test_zero_g_offset_follows_the_temperature() -> None:
    errors = replace(no_errors(), zero_g_offset_g_per_c=np.array([1e-3, 0.0, -2e-3]))
    part = Accelerometer(errors, odr_hz=1e-9)
    counts = part.counts(np.zeros((2, 3)), np.array([25.0, 35.0]), np.random.default_rng(0))
    assert counts.tolist() == [[0, 0, 0], [2560, 0, -5120]]


def test_the_mount_rotates_the_force_into_the_sensors_axes() -> None:
    tilt = np.radians(2.0)
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]])
    errors = replace(no_errors(), sensor_from_housing=turn, scale_factor_error=np.array([0.0, 0.05, -0.02]))
    part = Accelerometer(errors, odr_hz=1e-9)
    counts = part.counts(np.array([[0.0, 0.0, 1.0]]), np.array([25.0]), np.random.default_rng(0))
    assert counts[0] / 256000 == pytest.approx([0, 1.05 * np.sin(tilt), 0.98 * np.cos(tilt)], abs=2e-6)


def test_ambient_temperature_rises_and_falls_about_its_mean() -> None:
    ambient = Ambient(mean_c=20.0, amplitude_c=2.0, period_s=100.0)
    assert ambient.temperature_c(np.array([0.0, 25.0, 75.0, 1e6 + 25.0])) == pytest.approx([20.0, 22.0, 18.0, 22.0])


def test_the_noise_does_not_depend_on_the_blocks() -> None:
    part = Accelerometer(typical_errors(np.random.default_rng(1), 25.0), odr_hz=125.0)
    force_g, temperature_c = np.tile([0.1, 0.0, 1.0], (100, 1)), np.linspace(24, 26, 100)
    one, many = np.random.default_rng(2), np.random.default_rng(2)
    parts = [part.counts(force_g[i : i + 7], temperature_c[i : i + 7], many) for i in range(0, 100, 7)]
    assert np.array_equal(part.counts(force_g, temperature_c, one), np.concatenate(parts))


def test_the_errors_of_the_factory_record_match_its_uncertainty() -> None:
    scores = []
    for seed in range(200):
        random = np.random.default_rng(seed)
        part = Accelerometer(typical_errors(random, 21.0), odr_hz=125.0)
        record = factory_calibration("simulated-1", part, random)
        truth = np.concatenate(
            [np.linalg.inv(part.errors.gain).ravel() / part.units_per_g, part.errors.zero_g_offset_g * part.units_per_g]
        )
        stated = np.concatenate([np.ravel(record["correction_matrix"]), record["offset"]])
        scores.append((stated - truth) / np.sqrt(np.diag(record["covariance"])))
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=0.12)  # four sigma of a mean of 2400 squares
    assert np.abs(np.mean(scores, axis=0)).max() < 0.3


def test_the_factory_record_corrects_a_sensor_at_rest_to_one_g() -> None:
    random = np.random.default_rng(7)
    part = Accelerometer(typical_errors(random, 21.0), odr_hz=125.0)
    record = factory_calibration("simulated-1", part, random)
    force_g = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -1.0, 0.0]])
    counts = np.mean([part.counts(force_g, np.full(3, 21.0), random) for _ in range(200)], axis=0)
    corrected_g = (counts - record["offset"]) @ np.array(record["correction_matrix"]).T
    assert corrected_g == pytest.approx(force_g, abs=1.5e-3)
    assert np.abs(np.linalg.norm(corrected_g, axis=1) - 1).max() < record["prediction_interval_g"]


def test_the_factory_record_has_a_hash_and_is_json() -> None:
    part = Accelerometer(typical_errors(np.random.default_rng(1), 21.0), odr_hz=125.0)
    record = json.loads(json.dumps(factory_calibration("simulated-4", part, np.random.default_rng(1))))
    seal = record.pop("sha256")
    assert seal == hashlib.sha256(json.dumps(record, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
    assert record["device_id"] == "simulated-4"
    assert (record["format"], record["method"], record["unit"], record["parent"]) == (1, "factory", "counts", None)
    assert np.shape(record["covariance"]) == (12, 12)
    assert record["temperature_c"]["mean"] == 21.0
