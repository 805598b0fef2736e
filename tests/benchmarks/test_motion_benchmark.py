"""The parts of the motion benchmark that decide its numbers: baseline, bound, tables of the page."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.motion import replace_tables
from tests.benchmarks.motion_baselines import complementary_angle, formula_angles, largest_of_last_period
from tests.benchmarks.motion_bound import Instruments, bound_rad
from tests.benchmarks.motion_recordings import GRAVITY_M_S2, WorkRecording, read
from tests.working_crane.__main__ import main as write_recordings


@pytest.fixture
def free_swing() -> WorkRecording:
    """A small planar free swing without noise, at rho 0.5."""
    length_m, above_m, amplitude = 10.0, 5.0, np.radians(2.0)
    rate = np.sqrt(GRAVITY_M_S2 / length_m)
    time_s = np.arange(3000) / 50
    angle = amplitude * np.cos(rate * time_s)
    force_g = np.column_stack([0.5 * np.sin(angle), 0 * angle, np.cos(angle)])
    nothing = np.zeros(3000)
    truth = {
        "time_s": time_s,
        "angle_deg": np.degrees(np.abs(angle)),
        "azimuth_deg": np.where(angle < 0, 180.0, 0.0),
        "length_m": nothing + length_m,
        "driven": nothing,
        "hoisting": nothing,
        "gust": nothing,
    }
    return WorkRecording("free", 0.5, 1e-4, length_m, above_m, time_s, force_g, truth)


def driven(recording: WorkRecording) -> WorkRecording:
    time_s = recording.truth["time_s"]
    return replace(recording, truth=recording.truth | {"driven": ((time_s > 20) & (time_s < 40)).astype(float)})


def test_complementary_filter_with_a_short_time_constant_is_right_in_a_free_swing(free_swing: WorkRecording) -> None:
    at_s = np.arange(30.0, 50.0, 0.1)

    error_deg = np.degrees(complementary_angle(free_swing, 0.05, at_s)) - free_swing.true("angle_deg", at_s)

    assert np.abs(error_deg).max() < 0.15


def test_equation_22_is_right_in_a_planar_free_swing_without_noise(free_swing: WorkRecording) -> None:
    at_s = np.arange(20.0, 40.0, 1.0)

    stated = np.degrees(formula_angles(free_swing, at_s))

    np.testing.assert_allclose(stated[:, 0], largest_of_last_period(free_swing, at_s), rtol=0.05)


@pytest.mark.slow
def test_bound_grows_in_a_drive_and_falls_afterwards(free_swing: WorkRecording) -> None:
    time_s, bound = bound_rad(driven(free_swing))

    before, end, after = (float(np.mean(bound[(time_s > a) & (time_s < a + 1)])) for a in (19.0, 38.9, 50.0))
    assert 2 * before < end < np.radians(1.0)
    assert after < end


@pytest.mark.slow
def test_bound_grows_with_the_noise(free_swing: WorkRecording) -> None:
    time_s, quiet = bound_rad(driven(free_swing))
    _, noisy = bound_rad(driven(replace(free_swing, noise_g=1e-3)))

    assert (noisy[time_s > 15] > 1.5 * quiet[time_s > 15]).all()


@pytest.mark.slow
@pytest.mark.parametrize("instruments", [Instruments(has_gyro=True), Instruments(second_above_load_m=1.0)])
def test_a_gyroscope_or_a_second_housing_lowers_the_bound_in_a_drive(
    free_swing: WorkRecording, instruments: Instruments
) -> None:
    time_s, alone = bound_rad(driven(free_swing))
    _, helped = bound_rad(driven(free_swing), instruments)

    drives = (time_s > 25) & (time_s < 40)
    assert (helped <= 1.001 * alone).all()
    assert helped[drives].mean() < 0.8 * alone[drives].mean()


@pytest.mark.slow
def test_a_second_housing_at_the_same_place_adds_nothing_but_a_second_reading(free_swing: WorkRecording) -> None:
    time_s, alone = bound_rad(driven(free_swing))
    _, twice = bound_rad(driven(free_swing), Instruments(second_above_load_m=free_swing.above_load_m))

    drives = (time_s > 35) & (time_s < 39)
    assert (twice[drives] > 0.5 * alone[drives]).all()
    assert (twice[drives] < alone[drives]).all()


@pytest.mark.slow
def test_an_unknown_hoist_makes_the_angle_less_certain(free_swing: WorkRecording) -> None:
    time_s, known = bound_rad(driven(free_swing))
    hoisting = ((free_swing.truth["time_s"] > 20) & (free_swing.truth["time_s"] < 40)).astype(float)
    recording = driven(free_swing)
    _, unknown = bound_rad(replace(recording, truth=recording.truth | {"hoisting": hoisting}))

    at = (time_s > 35) & (time_s < 39)
    assert (unknown[at] > 1.2 * known[at]).all()


@pytest.mark.slow
def test_a_moving_base_makes_the_angle_less_certain(free_swing: WorkRecording) -> None:
    time_s, rigid = bound_rad(free_swing)
    _, floating = bound_rad(free_swing, has_moving_base=True)

    assert (floating[time_s > 30] > 2 * rigid[time_s > 30]).all()


@pytest.fixture
def written(tmp_path: Path) -> Path:
    write_recordings([str(tmp_path), "--seed", "5", "--count", "1"])
    return tmp_path / "work_000"


@pytest.mark.slow
def test_written_recordings_are_read(written: Path) -> None:
    recording = read(written)

    assert recording.force_g.shape == (len(recording.time_s), 3)
    assert recording.truth["angle_deg"].max() > 0
    assert set(recording.manoeuvre(recording.time_s)) <= set(range(5))


def test_tables_of_the_page_are_replaced_between_their_comments() -> None:
    page = "a\n<!-- script/bench motion: rho -->\nold\n<!-- end -->\nb\n"

    once = replace_tables(page, {"rho": "| new |"})

    assert once == "a\n<!-- script/bench motion: rho -->\n\n| new |\n\n<!-- end -->\nb\n"
    assert replace_tables(once, {"rho": "| new |"}) == once
    with pytest.raises(ValueError, match="no place for the table noise"):
        replace_tables(page, {"noise": ""})
