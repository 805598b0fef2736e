"""The motion over a whole recording, against the true angle and against the live one."""

from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.schedule import Gust, Hoist, TrolleyMove
from gateway.motion.estimate import MotionState
from gateway.motion.history import MotionHistory
from gateway.motion.smoother import smooth_motion
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.gateway.motion.conftest import Recording, follow, new_tracker, swing
from tests.values import present

MOUNT_U_RAD = 1e-3
WORK = (
    TrolleyMove(start_s=12.0, duration_s=10.0, ramp_s=3.0, speed_m_s=0.8, azimuth_rad=0.4),
    Hoist(start_s=32.0, duration_s=8.0, by_m=-2.0),
    Gust(start_s=50.0, duration_s=8.0, force_m_s2=0.08, azimuth_rad=1.0),
)


def smooth(recording: Recording) -> MotionHistory:
    return smooth_motion(recording.time_s, recording.force_g, recording.rig, MOUNT_U_RAD)


def errors_rad(recording: Recording, history: MotionHistory) -> Array:
    return history.angle_rad - np.interp(history.time_s, recording.time_s, recording.angle_rad)


def coverage(error: Array, u: Array) -> float:
    return float((np.abs(error) <= NORMAL_975 * u).mean())


@pytest.fixture(scope="module")
def workings() -> tuple[Recording, ...]:
    """Two draws of noise, zero-g offsets and azimuth."""
    return tuple(swing(seed=seed, duration_s=75.0, amplitude_deg=2.0, events=WORK) for seed in (5, 6))


@pytest.fixture(scope="module")
def histories(workings: tuple[Recording, ...]) -> tuple[MotionHistory, ...]:
    return tuple(map(smooth, workings))


@pytest.fixture(scope="module")
def working(workings: tuple[Recording, ...]) -> Recording:
    return workings[0]


@pytest.fixture(scope="module")
def history_of_working(histories: tuple[MotionHistory, ...]) -> MotionHistory:
    return histories[0]


@pytest.fixture(scope="module")
def history_of_free(free_swing: Recording) -> MotionHistory:
    return smooth(free_swing)


@pytest.mark.slow
def test_the_smoothed_angle_of_a_free_swing_is_better_than_the_live_one(
    free_swing: Recording, history_of_free: MotionHistory
) -> None:
    history, live = history_of_free, list(follow(free_swing))
    period_s = free_swing.rig.small_swing_period_s
    ratios = [np.interp(one.time_s, history.time_s, history.u_rad) / present(one.u_rad) for one in live]
    in_first_periods = np.array([one.time_s < 2 * period_s for one in live])
    assert np.median(np.array(ratios)[in_first_periods]) < 0.8
    error_rad = errors_rad(free_swing, history)
    live_error_rad = [present(one.angle_rad) - free_swing.angle_at(one.time_s) for one in live]
    assert np.sqrt((error_rad**2).mean()) < np.sqrt(np.square(live_error_rad).mean())
    assert coverage(error_rad, history.u_rad) > 0.92
    assert set(history.state) == {"free"}
    # the angle is known from the first reading on
    assert history.u_rad[0] < 0.2 * present(live[0].u_rad)
    assert abs(errors_rad(free_swing, history)[0]) < NORMAL_975 * history.u_rad[0]


@pytest.mark.slow
def test_a_swing_without_damping_played_backward_gives_the_same_angles() -> None:
    recording = swing(seed=3, duration_s=30.0, damping_ratio=0.0)
    history = smooth(recording)
    mirrored = smooth(replace(recording, time_s=-recording.time_s[::-1], force_g=recording.force_g[::-1]))
    angle_rad = np.interp(history.time_s, -mirrored.time_s[::-1], mirrored.angle_rad[::-1])
    u_rad = np.hypot(history.u_rad, np.interp(history.time_s, -mirrored.time_s[::-1], mirrored.u_rad[::-1]))
    assert (np.abs(angle_rad - history.angle_rad) < NORMAL_975 * u_rad).all()
    assert np.median(mirrored.u_rad) == pytest.approx(np.median(history.u_rad), rel=0.2)


@pytest.mark.slow
def test_drive_hoist_and_gust_are_followed_with_intervals_that_hold(
    workings: tuple[Recording, ...], histories: tuple[MotionHistory, ...]
) -> None:
    errors = np.concatenate([errors_rad(*pair) for pair in zip(workings, histories, strict=True)])
    assert np.isfinite(errors).all()
    assert np.degrees(np.sqrt((errors**2).mean())) < 0.05
    assert coverage(errors, np.concatenate([history.u_rad for history in histories])) > 0.92


def test_rope_phases_and_largest_angle_of_a_working_crane(
    workings: tuple[Recording, ...], histories: tuple[MotionHistory, ...]
) -> None:
    for working, history in zip(workings, histories, strict=True):
        assert history.length_m[-1] == pytest.approx(8.0, abs=3 * history.length_u_m[-1])
        assert {"free", "driven", "hoisting"} <= {phase.state for phase in history.phases()}
        largest = present(history.largest_angle())
        low, high = largest.coverage95_rad
        assert low < working.angle_rad.max() < high
        assert largest.time_s == pytest.approx(working.time_s[working.angle_rad.argmax()], abs=0.3)


def test_the_largest_angle_of_a_recording_is_that_of_one_of_its_phases(histories: tuple[MotionHistory, ...]) -> None:
    """Also where a phase begins with it."""
    for history in histories:
        top, count = int(np.nanargmax(history.angle_rad)), len(history.state)
        kinds: tuple[MotionState, MotionState] = ("driven", "free")
        begins = replace(history, state=kinds[:1] * top + kinds[1:] * (count - top))
        driven, free = begins.phases()
        assert begins.largest_angle() == free.largest != driven.largest


@pytest.mark.slow
def test_live_and_smoothed_angles_agree_within_their_intervals(
    working: Recording, history_of_working: MotionHistory
) -> None:
    history, live = history_of_working, list(follow(working))
    time_s = np.array([estimate.time_s for estimate in live])
    difference = np.array([present(estimate.angle_rad) for estimate in live]) - np.interp(
        time_s, history.time_s, history.angle_rad
    )
    u_rad = np.hypot([present(estimate.u_rad) for estimate in live], np.interp(time_s, history.time_s, history.u_rad))
    assert coverage(difference, u_rad) > 0.95
    assert np.abs(difference / u_rad).max() < 4.0


@pytest.mark.slow
def test_smoothing_in_blocks_is_smoothing_at_once(
    monkeypatch: pytest.MonkeyPatch, free_swing: Recording, history_of_free: MotionHistory
) -> None:
    """What comes later than the lookahead is left out; it is not much."""
    whole = history_of_free
    monkeypatch.setattr("gateway.motion.smoother.BLOCK_STEPS", 30)
    monkeypatch.setattr("gateway.motion.smoother.LOOKAHEAD_STEPS", 40)
    monkeypatch.setattr("gateway.motion.smoother.SAMPLES", 100)
    blocks = smooth(free_swing)
    assert blocks.time_s == pytest.approx(whole.time_s, abs=1e-9)
    assert np.abs(blocks.angle_rad - whole.angle_rad).max() < 0.5 * whole.u_rad.max()
    assert coverage(blocks.angle_rad - whole.angle_rad, np.hypot(blocks.u_rad, whole.u_rad)) == 1.0


@pytest.mark.slow
def test_a_long_gap_forgets_the_motion_and_keeps_what_is_known_of_the_crane(free_swing: Recording) -> None:
    first = free_swing.time_s < 12.0
    time_s, force_g = free_swing.time_s[first], free_swing.force_g[first]
    later_s = 3000 * new_tracker(free_swing.rig).bin_s  # so that the bins hold the same samples
    twice = smooth_motion(
        np.concatenate([time_s, time_s + later_s]), np.tile(force_g, (2, 1)), free_swing.rig, MOUNT_U_RAD
    )
    n = len(twice.time_s) // 2
    assert twice.time_s[n] - twice.time_s[n - 1] > 900
    difference = twice.angle_rad[n:] - twice.angle_rad[:n]
    assert coverage(difference, np.hypot(twice.u_rad[:n], twice.u_rad[n:])) == 1.0
    assert np.median(twice.u_rad[n:]) < np.median(twice.u_rad[:n])


def test_every_bin_of_the_stream_is_in_the_history(working: Recording, history_of_working: MotionHistory) -> None:
    bin_s = new_tracker(working.rig).bin_s
    labels = np.floor(history_of_working.time_s / bin_s)
    assert labels == pytest.approx(np.arange(np.ceil(working.time_s[-1] / bin_s)))
    assert np.isfinite(history_of_working.angle_rad).all()


@pytest.mark.slow
def test_a_gap_within_a_recording_widens_the_interval_there_alone(
    free_swing: Recording, history_of_free: MotionHistory
) -> None:
    gap_s = 1.2 * free_swing.rig.small_swing_period_s
    history, whole = smooth(free_swing.without(15.0, 15.0 + gap_s)), history_of_free
    assert not ((history.time_s > 15.4) & (history.time_s < 14.6 + gap_s)).any()
    error_rad = errors_rad(free_swing, history)
    assert coverage(error_rad, history.u_rad) > 0.92
    late = history.time_s > 30.0
    assert history.u_rad[late] == pytest.approx(whole.u_rad[whole.time_s > 30.0], rel=0.2)


def test_a_summit_between_two_bins_is_the_parabolas(history_of_working: MotionHistory) -> None:
    history = history_of_working
    time_s = history.time_s[:3]
    angle_rad = 0.1 - (time_s - time_s[1] - 0.02) ** 2
    three = replace(history.between(time_s[0], time_s[2]), angle_rad=angle_rad, u_rad=np.full(3, 1e-3))
    largest = present(three.largest_angle())
    assert largest.angle_rad == pytest.approx(0.1)
    assert largest.time_s == pytest.approx(time_s[1] + 0.02)
