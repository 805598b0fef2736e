"""The noise of a sensor that nobody states, measured from its recording."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gateway.measurement.source import read_source
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.sensor import measure_noise_g, with_measured_noise

RATE_HZ = 50.0
NOISE_G = np.array([2e-3, 5e-4, 1e-3])
TIME_S = np.arange(0, 60, 1 / RATE_HZ)


def swing(amplitude_rad: float = 0.5, period_s: float = 1.2) -> np.ndarray:
    """Readings at the pivot of a short pendulum, with the noise of `NOISE_G`."""
    angle_rad = amplitude_rad * np.exp(-TIME_S / 80) * np.cos(2 * np.pi * TIME_S / period_s)
    clean_g = np.column_stack([np.sin(angle_rad), 0 * TIME_S, np.cos(angle_rad)])
    return np.asarray(clean_g + NOISE_G * np.random.default_rng(5).standard_normal(clean_g.shape))


def test_noise_is_measured_beside_a_large_swing() -> None:
    assert measure_noise_g(swing()) == pytest.approx(NOISE_G, rel=0.15)


def test_a_line_of_a_machine_is_no_noise() -> None:
    line_g = 0.02 * np.sin(2 * np.pi * 16.4 * TIME_S)[:, None]

    assert measure_noise_g(swing() + line_g) == pytest.approx(NOISE_G, rel=0.2)


def test_spikes_and_gaps_are_no_noise() -> None:
    readings_g = swing()
    readings_g[::97] += 0.3
    readings_g = np.delete(readings_g, slice(1000, 1040), axis=0)

    assert measure_noise_g(readings_g) == pytest.approx(NOISE_G, rel=0.2)


def test_too_few_samples_show_no_noise() -> None:
    assert measure_noise_g(swing()[:40]) is None


def test_readings_without_noise_have_the_least_that_a_sensor_has() -> None:
    angle_rad = 0.5 * np.cos(2 * np.pi * TIME_S / 1.2)

    assert measure_noise_g(np.column_stack([np.sin(angle_rad), 0 * TIME_S, np.cos(angle_rad)])) == pytest.approx(1e-4)


def recorded(path: Path, readings_g: np.ndarray) -> Path:
    table = np.column_stack([TIME_S, readings_g])
    np.savetxt(path, table, "%.7f", ",", header="time_s,ax_g,ay_g,az_g", comments="")
    return path


def test_noise_of_the_recording_replaces_that_of_a_rig_that_states_none(tmp_path: Path) -> None:
    source = read_source([recorded(tmp_path / "log.csv", swing())])
    believed = Model(TwinRig(length_m=0.36, position_m=0.0), {})
    measured, remark = with_measured_noise(believed, source)

    assert measured.rig.noise_g == pytest.approx(NOISE_G, rel=0.15)
    assert remark is not None
    assert "because the rig states none" in remark
    assert with_measured_noise(believed, replace(source, noise_g=1e-3)) == (believed, None)


def test_the_error_of_coarse_steps_is_not_counted_as_noise(tmp_path: Path) -> None:
    step_g = 0.016
    source = read_source([recorded(tmp_path / "log.csv", step_g * np.round(swing() / step_g))])
    measured, _ = with_measured_noise(Model(TwinRig(length_m=0.36, position_m=0.0), {}), source)

    assert max(measured.rig.noise_g) < step_g / np.sqrt(12)
