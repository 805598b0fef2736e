"""What the samples show of their sensor: noise, quantisation, saturation and spikes; and recordings that cannot be used."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.measurement.source import HeldRows, read_source
from gateway.twin.model import Model, TwinRig
from gateway.twin.reconcile.data.data_checks import find_fault
from gateway.twin.reconcile.data.observations import Observations, detect_spikes, make_observations, split_recordings
from gateway.twin.reconcile.data.sensor import (
    detect_quantisation_step,
    detect_saturation,
    measure_noise_g,
    quantised_mean_g,
    regular_reading_times,
    with_measured_noise,
)
from gateway.twin.reconcile.output.result import Curves
from gateway.twin.reconcile.output.serialisation import format_prediction_csv
from gateway.twin.reconcile.search.steps import detect_in_samples
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.reconcile.conftest import swing

Array = NDArray[np.float64]
Record = Callable[..., Observations]
NOISE_G = np.full(3, 5e-4)
COARSE_STEP_G = 0.043
RATE_HZ = 50.0
SENSOR_NOISE_G = np.array([2e-3, 5e-4, 1e-3])
READING_S = np.arange(0, 60, 1 / RATE_HZ)


def test_quantisation_step_is_found_to_a_millionth(record: Record) -> None:
    force_g = record({}).force_g
    step_g = 0.0041237
    written = np.round(step_g * np.round(force_g / step_g), 7)

    assert detect_quantisation_step(written, NOISE_G) == pytest.approx(step_g, rel=1e-6)
    assert detect_quantisation_step(np.round(force_g, 7), NOISE_G) is None


@pytest.mark.parametrize(("step_g", "is_effect"), [(0.8e-3, False), (1.5e-3, True)])
def test_a_step_that_the_noise_dithers_is_noise_and_no_effect(record: Record, step_g: float, is_effect: bool) -> None:
    log, held_out = (record({}, name) for name in ("log", "held_out"))
    log, held_out = (replace(each, force_g=step_g * np.round(each.force_g / step_g)) for each in (log, held_out))
    recordings, detected = detect_in_samples(split_recordings(log, held_out, 5.0), 1.0, {})

    assert ("quantization" in detected) is is_effect
    assert recordings.log.noise_g == pytest.approx(np.sqrt(NOISE_G**2 + step_g**2 / 12))


def test_saturation_level_is_found_and_the_maximum_of_noise_is_none(record: Record) -> None:
    force_g = record({}).force_g

    assert detect_saturation(np.minimum(force_g, 1.001)) == pytest.approx(1.001)
    assert detect_saturation(force_g) is None


def test_gravity_at_the_lowest_point_is_no_limit() -> None:
    """Angles of an encoder in steps, as a housing at the pivot reads them until the swing has died away."""
    time_s = np.arange(0, 11, 0.01)
    angle_rad = 0.0005 * np.round(0.44 * np.exp(-time_s / 1.5) * np.cos(6 * time_s) / 0.0005)
    force_g = np.stack([np.sin(angle_rad), np.zeros_like(time_s), np.cos(angle_rad)], axis=1)
    assert np.count_nonzero(force_g[:, 2] == 1) > 20
    assert detect_saturation(force_g) is None


def test_a_short_log_and_repeated_readings_are_not_saturated(record: Record) -> None:
    """One reading of 200 is more than the share that shows a limit; a slow sensor gives each reading three times."""
    force_g = record({}).force_g[:200]

    assert detect_saturation(force_g) is None
    assert detect_saturation(np.repeat(force_g, 5, axis=0)) is None
    assert detect_saturation(np.minimum(force_g, np.sort(force_g[:, 2])[-20])) == pytest.approx(
        np.sort(force_g[:, 2])[-20]
    )


def test_quantised_mean_equals_the_mean_of_many_noisy_readings() -> None:
    rng = np.random.default_rng(1)
    force_g = np.linspace(-0.013, 0.013, 30).reshape(10, 3)
    drawn = np.mean(
        [0.005 * np.round((force_g + 1e-3 * rng.normal(size=force_g.shape)) / 0.005) for _ in range(4000)], axis=0
    )

    np.testing.assert_allclose(quantised_mean_g(force_g, 0.005, np.full(3, 1e-3)), drawn, atol=2e-4)


def test_lone_spike_is_excluded_and_a_swing_is_not(record: Record) -> None:
    force_g = record({}).force_g.copy()
    force_g[500, 2] += 0.05
    found = detect_spikes(force_g)

    assert found[500]
    assert found[0]
    assert found.sum() <= 4  # a neighbour of the spike may be excluded, too


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda t, f: (t[:100], f[:100]), "too short"),
        (lambda t, f: (t[:220], f[:220]), "too short"),
        (lambda t, f: (t, f * 9.80665), "wrong units"),
        (lambda t, f: (t, 0 * f + [0, 0, 1] + 5e-4 * np.random.default_rng(1).normal(size=f.shape)), "static"),
        (lambda t, f: (t, f + np.random.default_rng(1).normal(size=f.shape)), "too noisy"),
        (lambda t, f: (t, f * [1, 1, 0] + [0, 0, 1.0]), "clipped or stuck"),
        (lambda t, f: (t, 0 * f + [0, 0, 1.0]), "stuck or quantised"),
        (lambda t, f: (t / 1.42, f), "the rig is wrong"),
    ],
)
def test_unusable_recording_is_refused_with_the_reason(
    record: Record, rig: TwinRig, change: Callable[[Array, Array], tuple[Array, Array]], reason: str
) -> None:
    observations = record({})
    time_s, force_g = change(observations.time_s, observations.force_g)

    assert reason in (find_fault(time_s, force_g, rig) or "")


def coarse_recording(rig: TwinRig, tilt_rad: float) -> tuple[Array, Array]:
    """Return times and readings of a swing in a plane, in steps of 43 mg."""
    recorded = swing(rig, {}, [tilt_rad, 0, 0, 0, 0], np.arange(0, 60, 1 / 20.0))
    return recorded.time_s, COARSE_STEP_G * np.round(recorded.force_g / COARSE_STEP_G)


@pytest.mark.parametrize(("position_m", "tilt_rad"), [(0.0, 0.07), (4.0, 0.07), (6.0, 0.2)])
def test_quantised_recording_with_constant_axes_is_usable(rig: TwinRig, position_m: float, tilt_rad: float) -> None:
    time_s, force_g = coarse_recording(replace(rig, position_m=position_m), tilt_rad)

    assert len(np.unique(force_g[:, 1])) == 1
    assert find_fault(time_s, force_g, rig) is None
    assert detect_quantisation_step(force_g, NOISE_G) == pytest.approx(COARSE_STEP_G)
    assert detect_spikes(force_g).sum() == 1  # the first sample


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.95, 1.0, 1.05])
def test_swing_that_shows_along_the_rope_alone_is_usable(rig: TwinRig, rho: float) -> None:
    noisy, time_s = replace(rig, position_m=rho * rig.length_m, noise_g=(2e-3,) * 3), np.arange(0, 60, 1 / 20.0)
    noise_g = 2e-3 * np.random.default_rng(1).normal(size=(len(time_s), 3))
    force_g = swing(noisy, {}, [0.1, 0, 0, 0, 0], time_s).force_g

    assert find_fault(time_s, force_g, noisy) is None
    assert find_fault(time_s, force_g, replace(noisy, length_m=2 * rig.length_m)) is not None
    bounce_g = [0, 0, 0.05] * np.sin(2 * np.pi * 1.7 * time_s)[:, None]
    assert "static" in (find_fault(time_s, np.array([0, 0, 1]) + noise_g + bounce_g, noisy) or "")


def test_swing_that_quantisation_hides_near_the_hook_is_not_called_clipped(rig: TwinRig) -> None:
    near_hook = replace(rig, position_m=7.6)
    no_step = find_fault(*coarse_recording(near_hook, 0.05), near_hook)

    assert find_fault(*coarse_recording(near_hook, 0.2), near_hook) is None  # it shows in the steps along the rope
    assert no_step is not None
    assert no_step.startswith("stuck or quantised")


def test_saturated_axis_of_a_quantised_recording_is_called_clipped(rig: TwinRig) -> None:
    time_s, force_g = coarse_recording(rig, 0.2)
    limit_g = 21 * COARSE_STEP_G

    assert "clipped or stuck" in (
        find_fault(time_s, np.minimum(force_g, limit_g), replace(rig, full_scale_g=limit_g)) or ""
    )


def plane_of_a_swing(rig: TwinRig) -> tuple[Array, Array]:
    """Return times and readings of x and z; y was not measured and reads zero."""
    recorded = swing(rig, {}, [0.2, 0, 0, 0, 0], np.arange(0, 60, 1 / 20.0))
    return recorded.time_s, recorded.force_g * [1, 0, 1]


def test_two_axes_in_the_plane_of_the_swing_suffice(rig: TwinRig) -> None:
    time_s, force_g = plane_of_a_swing(rig)

    assert find_fault(time_s, force_g, rig) is None
    assert "stuck" in (find_fault(time_s, force_g * [0, 0, 1], rig) or "")
    assert "stuck" in (find_fault(time_s, force_g + np.array([0, 0.3, 0]), rig) or "")


def test_an_axis_that_was_not_measured_counts_for_nothing(rig: TwinRig) -> None:
    observations = make_observations(*plane_of_a_swing(rig)[:2], None, np.array(rig.noise_g))
    simulator = Simulator(rig, [])
    simulated_g = simulator.predict(simulator.values([0.2, 0, 0, 0, 0], {}), observations.time_s)

    assert observations.n_values == 2 * observations.used.sum()
    assert observations.reduced_chi2(simulated_g) == pytest.approx(1, abs=0.1)


def test_the_amplitude_of_a_part_that_begins_while_the_crane_works_is_that_of_its_rest() -> None:
    time_s = np.arange(0, 60, 0.05)
    angle_rad = 0.3 * np.cos(2 * np.pi * time_s / 5)
    force_g = np.column_stack([np.sin(angle_rad), 0 * time_s, np.cos(angle_rad)])
    working = make_observations(time_s, force_g, None, np.full(3, 1e-3))
    resting = replace(working, used=time_s > 40)
    assert resting.amplitude_rad == pytest.approx(0.3, abs=0.01)


def test_the_amplitude_of_a_long_swing_that_decays_is_large() -> None:
    """A bob on a string from 87 degrees, filmed for 260 s: the mean along the rope changes by more than its line is high."""
    random = np.random.default_rng(4)
    time_s = np.arange(0, 260, 1 / 30.0)
    amplitude_rad = 1.52 / (1 + time_s / 40)
    rate_1_s = 2 * np.pi / 1.1 / np.array([period_ratio(each) for each in amplitude_rad])
    phase = np.concatenate([[0.0], np.cumsum(rate_1_s[1:] * np.diff(time_s))])
    angle_rad = amplitude_rad * np.cos(phase)
    force_g = np.column_stack([np.sin(angle_rad), 0 * time_s, np.cos(angle_rad)])
    force_g[:, ::2] += 1e-3 * random.normal(size=(len(time_s), 2))
    is_blurred = random.random(len(time_s)) < amplitude_rad * np.abs(np.sin(phase)) ** 0.5
    time_s, force_g = time_s[~is_blurred], force_g[~is_blurred]

    assert make_observations(time_s, force_g, None, np.full(3, 1e-3)).has_large_amplitude


def test_slack_rope_is_reported_as_free_fall(record: Record, rig: TwinRig) -> None:
    observations = record({})
    force_g = observations.force_g.copy()
    force_g[400:420] *= 0.1  # one second; the period is 5.7 s

    assert "in free fall" in (find_fault(observations.time_s, force_g, rig) or "")
    force_g[400:413] = observations.force_g[400:413]
    assert find_fault(observations.time_s, force_g, rig) is None


def test_usable_recording_is_not_refused(record: Record, rig: TwinRig) -> None:
    observations = record({})

    assert find_fault(observations.time_s, observations.force_g, rig) is None


@pytest.mark.parametrize("rows_per_reading", [2.5, 3.0, 5.7])
def test_readings_at_a_steady_rate_lose_the_changing_delay_of_their_rows(rows_per_reading: float) -> None:
    """A row shows a reading 0 to 1 row late; the delay that is left is the same for all, also across a gap."""
    number = np.delete(np.arange(400), slice(150, 171))
    taken_s = 0.02 * rows_per_reading * number
    row_s = 0.02 * np.ceil(taken_s / 0.02 - 1e-9)
    row_s[0] += 0.04  # the recording began while this reading was held
    found_s = regular_reading_times(row_s, rows_per_reading)

    assert np.ptp(found_s - taken_s) < 0.2 * np.ptp(row_s[1:] - taken_s[1:]) + 1e-9
    assert -1e-9 < np.mean(found_s - taken_s) < 0.02


def test_readings_at_uneven_times_keep_them() -> None:
    time_s = np.cumsum(np.random.default_rng(2).uniform(0.03, 0.09, 300))
    assert regular_reading_times(time_s, 3.0) is time_s


def test_prediction_of_repeated_readings_has_a_row_for_each_of_them() -> None:
    time_s, force_g = 0.06 * np.arange(4.0), np.arange(12.0).reshape(4, 3)
    curves = Curves(time_s, force_g, force_g, force_g, np.ones(4, dtype=bool), np.ones(3))
    held = HeldRows(5.0 + 0.02 * np.arange(12.0), np.arange(12) // 3)
    rows = format_prediction_csv([curves], held).splitlines()[1:]

    assert [row.split(",")[0] for row in rows] == [f"{0.02 * i:.6f}" for i in range(12)]
    assert [float(row.split(",")[1]) for row in rows] == [0.0] * 3 + [3.0] * 3 + [6.0] * 3 + [9.0] * 3


def short_swing(amplitude_rad: float = 0.5, period_s: float = 1.2) -> np.ndarray:
    """Readings at the pivot of a short pendulum, with the noise of `SENSOR_NOISE_G`."""
    angle_rad = amplitude_rad * np.exp(-READING_S / 80) * np.cos(2 * np.pi * READING_S / period_s)
    clean_g = np.column_stack([np.sin(angle_rad), 0 * READING_S, np.cos(angle_rad)])
    return np.asarray(clean_g + SENSOR_NOISE_G * np.random.default_rng(5).standard_normal(clean_g.shape))


def test_noise_is_measured_beside_a_large_swing() -> None:
    assert measure_noise_g(short_swing()) == pytest.approx(SENSOR_NOISE_G, rel=0.15)


def test_a_line_of_a_machine_is_no_noise() -> None:
    line_g = 0.02 * np.sin(2 * np.pi * 16.4 * READING_S)[:, None]

    assert measure_noise_g(short_swing() + line_g) == pytest.approx(SENSOR_NOISE_G, rel=0.2)


def test_spikes_and_gaps_are_no_noise() -> None:
    readings_g = short_swing()
    readings_g[::97] += 0.3
    readings_g = np.delete(readings_g, slice(1000, 1040), axis=0)

    assert measure_noise_g(readings_g) == pytest.approx(SENSOR_NOISE_G, rel=0.2)


def test_too_few_samples_show_no_noise() -> None:
    assert measure_noise_g(short_swing()[:40]) is None


def test_readings_without_noise_have_the_least_that_a_sensor_has() -> None:
    angle_rad = 0.5 * np.cos(2 * np.pi * READING_S / 1.2)

    assert measure_noise_g(np.column_stack([np.sin(angle_rad), 0 * READING_S, np.cos(angle_rad)])) == pytest.approx(
        1e-4
    )


def recorded(path: Path, readings_g: np.ndarray) -> Path:
    table = np.column_stack([READING_S, readings_g])
    np.savetxt(path, table, "%.7f", ",", header="time_s,ax_g,ay_g,az_g", comments="")
    return path


def test_noise_of_the_recording_replaces_that_of_a_rig_that_states_none(tmp_path: Path) -> None:
    source = read_source([recorded(tmp_path / "log.csv", short_swing())])
    believed = Model(TwinRig(length_m=0.36, position_m=0.0), {})
    measured, remark = with_measured_noise(believed, source)

    assert measured.rig.noise_g == pytest.approx(SENSOR_NOISE_G, rel=0.15)
    assert remark is not None
    assert "because the rig states none" in remark
    assert with_measured_noise(believed, replace(source, noise_g=1e-3)) == (believed, None)


def test_the_error_of_coarse_steps_is_not_counted_as_noise(tmp_path: Path) -> None:
    step_g = 0.016
    source = read_source([recorded(tmp_path / "log.csv", step_g * np.round(short_swing() / step_g))])
    measured, _ = with_measured_noise(Model(TwinRig(length_m=0.36, position_m=0.0), {}), source)

    assert max(measured.rig.noise_g) < step_g / np.sqrt(12)
