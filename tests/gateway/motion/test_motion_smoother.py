"""The motion over a whole recording: bins, reversal of time, the combination of two directions, and the smoothed history."""

from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.schedule import Gust, Hoist, TrolleyMove
from gateway.motion.binning import Binning
from gateway.motion.filter_history import KEPT, FilterHistory, MixtureSeries, reverse_time
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import N_HYPOTHESES
from gateway.motion.mixing import Mixture
from gateway.motion.recording_bins import bin_recording
from gateway.motion.rope_model import RopeModel
from gateway.motion.smoother import smooth_motion
from gateway.motion.state_vector import GRAVITY, HOIST_SPEED, LN_LENGTH, N_STATES, PLACE, RATE
from gateway.motion.two_filter import LARGEST_GAIN, NEAR_BINS, combine, evidence_gain
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.gateway.motion.conftest import GRAVITY_M_S2, Recording, follow, swing
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


def test_a_recording_has_the_bins_of_its_stream(free_swing: Recording) -> None:
    binning, streamed = Binning(0.1), []
    for part in np.array_split(np.arange(len(free_swing.time_s)), 37):
        streamed += binning.add(free_swing.time_s[part], free_swing.force_g[part])
    whole = bin_recording(free_swing.time_s, free_swing.force_g, np.zeros(len(free_swing.time_s), dtype=bool), 0.1)
    assert len(whole) == len(streamed) + 1
    for one, other in zip(streamed, whole, strict=False):
        assert (one.count, one.is_clipped) == (other.count, other.is_clipped)
        assert other.time_s == pytest.approx(one.time_s)
        assert other.force_g == pytest.approx(one.force_g)


def test_a_clipped_sample_marks_its_bin_alone(free_swing: Recording) -> None:
    is_clipped = np.zeros(len(free_swing.time_s), dtype=bool)
    is_clipped[12] = True
    bins = bin_recording(free_swing.time_s, free_swing.force_g, is_clipped, 0.1)
    assert [place for place, one in enumerate(bins) if one.is_clipped] == [2]


def random_mixture() -> Mixture:
    rng = np.random.default_rng(4)
    state = 0.1 * rng.normal(size=(N_HYPOTHESES, N_STATES))
    state[:, LN_LENGTH], state[:, PLACE] = np.log(12.0), 5.0
    root = rng.normal(size=(N_HYPOTHESES, N_STATES, N_STATES))
    return Mixture(state, root @ root.transpose(0, 2, 1), np.full(N_HYPOTHESES, 1 / N_HYPOTHESES))


@pytest.mark.parametrize("is_clamped", [True, False])
def test_the_equations_hold_with_time_reversed(is_clamped: bool) -> None:
    model, mixture = RopeModel(GRAVITY_M_S2, is_clamped), random_mixture()
    reversed_mixture = reverse_time(mixture)
    rate, _ = model.rate(mixture.state)
    expected = reverse_time(replace(mixture, state=-rate)).state
    found, _ = model.rate(reversed_mixture.state)
    states = [*range(GRAVITY.start, GRAVITY.stop), *range(RATE.start, RATE.stop), LN_LENGTH, HOIST_SPEED]
    assert found[:, states] == pytest.approx(expected[:, states])
    reading, _, _ = model.reading(mixture.state)
    reading_reversed, _, _ = model.reading(reversed_mixture.state)
    assert reading_reversed == pytest.approx(reading)


def test_time_reversed_twice_is_the_same() -> None:
    mixture = random_mixture()
    twice = reverse_time(reverse_time(mixture))
    assert (twice.state == mixture.state).all()
    assert (twice.covariance == mixture.covariance).all()


def gaussian(mean: float, variance: float) -> Mixture:
    """The same for every hypothesis and every kept state."""
    k = len(KEPT)
    covariance = np.tile(variance * np.eye(k), (N_HYPOTHESES, 1, 1))
    return Mixture(np.full((N_HYPOTHESES, k), mean), covariance, np.full(N_HYPOTHESES, 1 / N_HYPOTHESES))


def series(mixture: Mixture) -> MixtureSeries:
    return MixtureSeries(mixture.state[None], mixture.covariance[None], mixture.weight[None])


def test_two_directions_count_what_was_known_before_once() -> None:
    # prior N(1, 4); each direction has seen one measurement of variance 2: 1.5 before, 2.5 after
    prior = gaussian(1.0, 4.0)
    variance = 1 / (1 / 4 + 1 / 2)
    first, later = (gaussian(variance * (1 / 4 + value / 2), variance) for value in (1.5, 2.5))
    found = combine(series(first), series(later), prior, np.ones(1), np.ones(1), np.zeros(1))
    expected = 1 / (1 / 4 + 1 / 2 + 1 / 2)
    angle = KEPT.index(GRAVITY.start)
    assert found.covariance[0, :, angle, angle] == pytest.approx(expected, rel=0.01)
    assert found.state[0, :, angle] == pytest.approx(expected * (1 / 4 + 1.5 / 2 + 2.5 / 2), rel=0.01)


def test_a_direction_that_knows_nothing_changes_nothing() -> None:
    prior, first = gaussian(0.0, 1.0), gaussian(0.3, 0.01)
    found = combine(series(first), series(prior), prior, np.full(1, 100.0), np.ones(1), np.zeros(1))
    angle = KEPT.index(GRAVITY.start)
    assert found.state[0] == pytest.approx(first.state, abs=1e-3)
    assert found.covariance[0, :, angle, angle] == pytest.approx(0.01, rel=0.02)


def test_directions_that_contradict_each_other_widen_the_interval() -> None:
    prior, first, later = gaussian(0.0, 1.0), gaussian(-0.3, 0.001), gaussian(0.3, 0.001)
    found = combine(series(first), series(later), prior, np.ones(1), np.ones(1), np.zeros(1))
    angle = KEPT.index(GRAVITY.start)
    assert np.sqrt(found.covariance[0, :, angle, angle]).min() > 0.2


@pytest.mark.parametrize(("gain", "expected"), [(30.0, -0.3), (-30.0, 0.3)])
def test_of_directions_that_contradict_each_other_the_one_with_the_better_evidence_is_right(
    gain: float, expected: float
) -> None:
    prior, first, later = gaussian(0.0, 1.0), gaussian(-0.3, 0.001), gaussian(0.3, 0.001)
    found = combine(series(first), series(later), prior, np.ones(1), np.ones(1), np.full(1, gain))
    angle = KEPT.index(GRAVITY.start)
    assert found.state[0, :, angle] == pytest.approx(expected, abs=0.01)


def test_the_evidence_near_a_bin_counts_and_an_outlier_decides_nothing() -> None:
    forward, backward = np.zeros(1000), np.zeros(1000)
    forward[500:] = 0.1
    forward[300] = 1e6
    gain = evidence_gain(forward, backward)
    assert gain[100] == 0.0
    assert gain[300] == LARGEST_GAIN
    assert gain[700] == pytest.approx(0.1 * (2 * NEAR_BINS + 1))
    assert gain[-1] == pytest.approx(0.1 * (NEAR_BINS + 1))


def test_the_smoothed_angle_of_a_free_swing_is_better_than_the_live_one(free_swing: Recording) -> None:
    history, live = smooth(free_swing), list(follow(free_swing))
    period_s = free_swing.rig.small_swing_period_s
    ratios = [np.interp(one.time_s, history.time_s, history.u_rad) / present(one.u_rad) for one in live]
    in_first_periods = np.array([one.time_s < 2 * period_s for one in live])
    assert np.median(np.array(ratios)[in_first_periods]) < 0.8
    error_rad = errors_rad(free_swing, history)
    live_error_rad = [present(one.angle_rad) - free_swing.angle_at(one.time_s) for one in live]
    assert np.sqrt((error_rad**2).mean()) < np.sqrt(np.square(live_error_rad).mean())
    assert coverage(error_rad, history.u_rad) > 0.92
    assert set(history.state) == {"free"}


def test_the_angle_is_known_from_the_first_reading_on(free_swing: Recording) -> None:
    history = smooth(free_swing)
    first = next(iter(follow(free_swing)))
    assert history.u_rad[0] < 0.2 * present(first.u_rad)
    assert abs(errors_rad(free_swing, history)[0]) < NORMAL_975 * history.u_rad[0]


def test_a_swing_without_damping_played_backward_gives_the_same_angles() -> None:
    recording = swing(seed=3, duration_s=30.0, damping_ratio=0.0)
    history = smooth(recording)
    mirrored = smooth(replace(recording, time_s=-recording.time_s[::-1], force_g=recording.force_g[::-1]))
    angle_rad = np.interp(history.time_s, -mirrored.time_s[::-1], mirrored.angle_rad[::-1])
    u_rad = np.hypot(history.u_rad, np.interp(history.time_s, -mirrored.time_s[::-1], mirrored.u_rad[::-1]))
    assert (np.abs(angle_rad - history.angle_rad) < NORMAL_975 * u_rad).all()
    assert np.median(mirrored.u_rad) == pytest.approx(np.median(history.u_rad), rel=0.2)


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
        assert {"free", "driven", "hoisting", "wind"} <= {phase.state for phase in history.phases()}
        largest = present(history.largest_angle())
        low, high = largest.coverage95_rad
        assert low < working.angle_rad.max() < high
        assert largest.time_s == pytest.approx(working.time_s[working.angle_rad.argmax()], abs=0.3)


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


def test_blocks_join_without_a_step(monkeypatch: pytest.MonkeyPatch, free_swing: Recording) -> None:
    whole = smooth(free_swing)
    monkeypatch.setattr("gateway.motion.smoother.BLOCK_BINS", 150)
    monkeypatch.setattr("gateway.motion.smoother.LOOKAHEAD_BINS", 150)
    blocks = smooth(free_swing)
    assert (blocks.time_s == whole.time_s).all()
    assert coverage(blocks.angle_rad - whole.angle_rad, np.hypot(blocks.u_rad, whole.u_rad)) == 1.0


def test_a_long_gap_divides_the_recording(free_swing: Recording) -> None:
    first = free_swing.time_s < 12.0
    time_s, force_g = free_swing.time_s[first], free_swing.force_g[first]
    twice = smooth_motion(
        np.concatenate([time_s, time_s + 1000.0]), np.tile(force_g, (2, 1)), free_swing.rig, MOUNT_U_RAD
    )
    n = len(twice.time_s) // 2
    assert twice.time_s[n] - twice.time_s[n - 1] > 900
    assert twice.angle_rad[n:] == pytest.approx(twice.angle_rad[:n], abs=1e-4)


def test_a_second_account_replaces_the_bins_that_it_has_taken(working: Recording) -> None:
    forward = FilterHistory(working.rig, mount_u_rad=MOUNT_U_RAD)
    bins = bin_recording(working.time_s, working.force_g, np.zeros(len(working.time_s), dtype=bool), forward.bin_s)
    for taken, one in enumerate(bins, start=1):
        forward.take(one)
        assert len(forward.mixtures) == taken


def test_a_summit_between_two_bins_is_the_parabolas(history_of_working: MotionHistory) -> None:
    history = history_of_working
    time_s = history.time_s[:3]
    angle_rad = 0.1 - (time_s - time_s[1] - 0.02) ** 2
    three = replace(history.between(time_s[0], time_s[2]), angle_rad=angle_rad, u_rad=np.full(3, 1e-3))
    largest = present(three.largest_angle())
    assert largest.angle_rad == pytest.approx(0.1)
    assert largest.time_s == pytest.approx(time_s[1] + 0.02)
