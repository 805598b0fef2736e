"""Structures of the crane that are told apart or followed: a housing on a spreader, and a base that never rests."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from devices.simulated.demo import demo_crane
from gateway.configuration.model import MountedOn
from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.swing.rig import MountedHousing
from tests.gateway.motion.conftest import (
    GRAVITY_M_S2,
    RATE_HZ,
    Recording,
    follow,
    holds,
    new_tracker,
    normalised_errors,
    sense,
    swing,
)
from tests.values import present
from tests.working_crane.real.recording import make


def simulated(kind: str, seed: int, index: int, duration_s: float) -> Recording:
    """A crane of the independent engine, with what a rigger states of it."""
    made = make(kind, seed, index, duration_s, 50.0)
    rig = MountedHousing(
        length_m=made.stated["length_m"],
        above_load_m=made.stated.get("above_load_m"),
        position_m=made.stated.get("position_m"),
        length_u_rel=0.05,
        position_u_m=0.05,
        zero_g_offset_u_g=(3e-4, 3e-4, 3e-4),
    )
    at: Array = np.interp(made.log_time_s, made.truth["time_s"], np.radians(made.truth["angle_deg"]))
    return Recording(made.log_time_s, made.reading_g, at, rig)


def names(tracker: MotionTracker) -> set[str]:
    return {candidate.name for candidate in tracker.candidates}


def near_the_load(*, tilt: float | None) -> Recording:
    """A free swing, and a housing 0.3 m above the load: on the rope, or on a spreader that tilts against it."""
    on_rope, at_pivot, at_load = (swing(seed=4, rho=rho, noise_g=0.0, offset_g=0.0) for rho in (0.97, 0.0, 1.0))
    force_g = on_rope.force_g
    if tilt is not None:
        tilted = (
            -(1 + tilt) * at_pivot.force_g[:, :2]
        )  # at the pivot of a free swing only gravity is left across the rope
        tension = at_load.force_g[:, 2:]
        force_g = tension * np.column_stack([tilted, 1 - 0.5 * (tilted**2).sum(axis=1)])
    noise_g = 4e-4 * np.random.default_rng(4).normal(size=force_g.shape)
    return replace(on_rope, force_g=force_g + noise_g)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "name"), [(None, "rope"), (0.15, "spreader"), (0.25, "spreader")])
def test_housing_on_a_spreader_is_told_from_one_on_a_rope(tilt: float | None, name: str) -> None:
    recording = near_the_load(tilt=tilt)
    tracker = new_tracker(recording.rig)
    assert names(tracker) == {"rope", "converging_ropes", "spreader"}

    estimates = list(follow(recording, tracker))

    assert name in names(tracker)
    assert names(tracker) - {"converging_ropes"} == {name}
    assert np.abs(normalised_errors(recording, [e for e in estimates if e.time_s > 15.0])).max() < 4


def test_only_a_housing_near_the_load_may_be_on_a_spreader() -> None:
    assert names(new_tracker(swing(duration_s=1.0, rho=0.5).rig)) == {"rope"}


@pytest.mark.parametrize("mounted_on", get_args(MountedOn))
@pytest.mark.parametrize("rho", [0.5, 0.99])
def test_what_is_stated_to_carry_the_housing_is_not_asked(mounted_on: MountedOn, rho: float) -> None:
    rig = replace(swing(duration_s=1.0, rho=rho).rig, mounted_on=mounted_on)
    assert names(new_tracker(rig)) == {mounted_on}


def test_a_housing_on_a_spreader_has_its_place_from_the_load() -> None:
    with pytest.raises(ValueError, match="spreader has its place from the load"):
        MountedHousing(length_m=10.0, position_m=9.0, mounted_on="spreader")


@pytest.mark.slow
def test_a_stated_spreader_is_followed_where_it_would_not_be_looked_for() -> None:
    """A head block that holds the housing 2 m above the middle of the load, on a rope of 10 m."""
    recording = near_the_load(tilt=0.15)
    stated = replace(recording, rig=replace(recording.rig, above_load_m=2.0, mounted_on="spreader"))

    estimates = list(follow(stated, new_tracker(stated.rig)))

    assert np.abs(normalised_errors(stated, [e for e in estimates if e.time_s > 15.0])).max() < 4


@pytest.mark.slow
def test_housing_on_the_spreader_of_a_container_crane_is_recognised() -> None:
    recording = simulated("d", 1, 1, 40.0)
    tracker = new_tracker(recording.rig)

    estimates = list(follow(recording, tracker))

    assert names(tracker) == {"spreader"}
    late = [e for e in estimates if e.time_s > 10.0]
    error_rad = np.array([present(e.angle_rad) - recording.angle_at(e.time_s) for e in late])
    assert np.sqrt((error_rad**2).mean()) < 0.1 * recording.angle_rad.max()


@pytest.mark.slow
def test_candidate_that_has_lost_its_numbers_does_not_spoil_the_other() -> None:
    recording = near_the_load(tilt=None)
    tracker = new_tracker(recording.rig)
    tracker.update(recording.time_s[:50], recording.force_g[:50])
    lost = next(candidate for candidate in tracker.candidates if candidate is not tracker.leader)
    lost.filter.mixture.covariance[:] *= -1e3

    for begin in range(50, 1000, 10):
        part = slice(begin, begin + 10)
        tracker.update(recording.time_s[part], recording.force_g[part])

    found = tracker.estimate(float(recording.time_s[999]))
    assert abs(normalised_errors(recording, [found])[0]) < 4


@pytest.mark.slow
def test_base_that_never_rests_keeps_its_interval() -> None:
    """Barges that roll in a regular and in an irregular sea move the pivot all the time."""
    held = []
    for index in (1, 2):
        recording = simulated("i", 1, index, 45.0)
        late = [e for e in follow(recording) if e.time_s > 10.0]
        assert all(e.angle_rad is not None for e in late)
        held += [holds(recording, e) for e in late]

    assert np.mean(held) > 0.9


@pytest.mark.slow
def test_a_start_in_the_middle_of_a_hoist_is_not_taken_for_a_floating_base() -> None:
    """The acceleration of a slow hoist looks like heave; the swing by the gusts after it is then no roll of a barge."""
    from_s, to_s = 80.0, 132.0
    time_s: Array = np.arange(from_s, to_s, 1 / RATE_HZ)
    force_g, angle_rad = sense(demo_crane(2, 12.0, 9.0, GRAVITY_M_S2), time_s)
    force_g += 2e-4 * np.random.default_rng(2).normal(size=force_g.shape)
    rig = MountedHousing(length_m=12.0, above_load_m=3.0, position_u_m=0.05, zero_g_offset_u_g=(3e-4, 3e-4, 3e-4))
    recording = Recording(time_s, force_g, angle_rad, rig)

    late = [e for e in follow(recording) if e.time_s > from_s + 7.0]

    above_deg = [np.degrees(present(e.angle_rad) - recording.angle_rad.max()) for e in late]
    assert max(above_deg) < 1.0
    assert np.mean([holds(recording, e) for e in late]) > 0.7
    assert late[-1].state != "driven"


@pytest.mark.slow
def test_a_long_hoist_is_followed_until_it_ends() -> None:
    """Ten metres to four: between its beginning and its end, nothing shows a steady speed."""
    recording = simulated("e", 11, 3, 120.0)
    early = recording.time_s < 45.0
    part = replace(recording, time_s=recording.time_s[early], force_g=recording.force_g[early])

    estimates = [e for e in follow(part, new_tracker(part.rig)) if e.time_s > 10.0]

    up = [present(e.hoist_m_s) for e in estimates if 19.0 < e.time_s < 31.0]
    assert max(up) < -0.1  # it is -0.38 m/s
    ended = [e for e in estimates if 33.0 < e.time_s < 37.5]  # then the trolley starts
    assert present(ended[-1].length_m) == pytest.approx(4.0, abs=0.3)
    assert np.mean([holds(recording, e) for e in ended]) > 0.9
