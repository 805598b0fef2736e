"""The motion filter as a live stream sees it: gaps, outliers, clipped and bad samples, blocks of any size, numerical health."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from devices.simulated.schedule import Event, Gust, Hoist, TrolleyMove
from gateway.motion.binning import Binning, ForceBin
from gateway.motion.candidate import FORGOTTEN_PERIODS, LONGEST_STEP_BINS, MotionCandidate
from gateway.motion.hypotheses import INITIAL_WEIGHTS, RESTING, STEADY, WINCH_LEVEL
from gateway.motion.initial_state import Constants
from gateway.motion.mixture import Mixture
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.motion_tracker import BINS_PER_PERIOD
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import HOIST_SPEED
from gateway.numerics.array import Array
from tests.gateway.motion.conftest import (
    GRAVITY_M_S2,
    RATE_HZ,
    Recording,
    follow,
    new_tracker,
    normalised_errors,
    swing,
)
from tests.values import present
from tests.working_crane.kinds import KINDS, case_seeds
from tests.working_crane.recording import record

BIN_S = 0.1
LENGTH_M, ABOVE_M = 10.0, 5.0
PERIOD_S = 2 * np.pi * np.sqrt(LENGTH_M / GRAVITY_M_S2)
SIGMA_G = np.full(3, 2e-4)
"""Of a bin."""
WORK = (
    TrolleyMove(5.0, 10.0, 4.0, 0.8, 0.5),
    Hoist(20.0, 8.0, -1.0),
    Gust(30.0, 8.0, 0.08, 1.0),
    TrolleyMove(36.0, 9.0, 3.0, -0.7, 2.0),
    Hoist(37.0, 6.0, 1.5),
)


def new_candidate() -> MotionCandidate:
    constants = Constants(LENGTH_M, 0.05, ABOVE_M, 0.02, (3e-4, 3e-4, 3e-4), 1e-3)
    model = RopeModel(GRAVITY_M_S2, LENGTH_M, is_clamped=True)
    return MotionCandidate(MotionFilter(model, constants), BIN_S, PERIOD_S, None, "rope")


def test_a_winch_that_seems_to_stand_is_soon_taken_to_rest() -> None:
    """After a hoist its speed is known to a decimetre a second: steadier readings cannot show that it is zero."""
    candidate = new_candidate()
    motion_filter = candidate.filter
    is_steady = WINCH_LEVEL == STEADY
    covariance = motion_filter.mixture.covariance.copy()
    covariance[is_steady, HOIST_SPEED, HOIST_SPEED] = 0.12**2
    weight = np.where(is_steady, INITIAL_WEIGHTS, 1e-12)
    motion_filter.mixture = Mixture(motion_filter.mixture.state, covariance, weight / weight.sum())

    for number in range(round(30.0 / BIN_S)):
        candidate.take(ForceBin(number * BIN_S, np.array([0.0, 0.0, 1.0]), 5, is_clipped=False), SIGMA_G)

    weight = motion_filter.mixture.weight
    assert weight[WINCH_LEVEL == RESTING].sum() > 0.5


def is_healthy(covariance: Array) -> bool:
    """Whether a covariance is finite, symmetric and positive apart from states that are exactly known."""
    sigma = np.sqrt(np.diagonal(covariance))
    known = sigma > 0
    correlation = covariance[np.ix_(known, known)] / np.outer(sigma[known], sigma[known])
    is_symmetric = np.allclose(correlation, correlation.T, atol=1e-9)
    return bool(np.isfinite(covariance).all() and is_symmetric and np.linalg.eigvalsh(correlation).min() > -1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("amplitude_deg", "events"),
    [(0.0, ()), (6.0, ()), (1.0, WORK)],
    ids=["rest", "swing", "work"],
)
def test_covariances_and_weights_stay_healthy(amplitude_deg: float, events: tuple[Event, ...]) -> None:
    recording = swing(amplitude_deg=amplitude_deg, events=events, duration_s=60.0, length_m=LENGTH_M)
    candidate = new_candidate()

    for number, one in enumerate(Binning(BIN_S).add(recording.time_s, recording.force_g)):
        candidate.take(one, SIGMA_G)
        mixture = candidate.filter.mixture
        assert mixture.weight.sum() == pytest.approx(1.0, abs=1e-12)
        assert (mixture.weight > 0).all()
        assert np.isfinite(candidate.filter.log_evidence)
        assert np.isfinite(candidate.filter.squared_innovation)
        assert np.isfinite(mixture.state).all()
        assert number % 7 or all(is_healthy(covariance) for covariance in mixture.covariance)


@pytest.mark.slow
@pytest.mark.parametrize("gap_s", [5.0, 60.0])
@pytest.mark.parametrize("seed", range(3))
def test_angle_after_a_gap_is_less_certain_and_soon_known(seed: int, gap_s: float) -> None:
    recording = swing(seed=seed, amplitude_deg=3.0 + 5 * seed, duration_s=37.0 + gap_s).without(25.0, 25.0 + gap_s)

    estimates = list(follow(recording, block=5))

    before = [e for e in estimates if e.time_s < 25.0][-1]
    after = [e for e in estimates if e.time_s > 25.0 + gap_s and e.angle_rad is not None]
    assert after[0].time_s < 25.0 + gap_s + 0.1 * gap_s
    assert np.abs(normalised_errors(recording, after)).max() < 4
    if gap_s < 10.0:
        assert present(after[0].u_rad) > present(before.u_rad)


@pytest.mark.slow
@pytest.mark.parametrize("gap_s", [10.0, 60.0])
def test_updates_after_a_gap_take_a_bounded_number_of_steps(monkeypatch: pytest.MonkeyPatch, gap_s: float) -> None:
    recording = swing(duration_s=30.0 + gap_s).without(20.0, 20.0 + gap_s)
    tracker, steps = new_tracker(recording.rig), [0]
    predict = MotionFilter.predict

    def counted(motion_filter: MotionFilter, time_s: float) -> None:
        steps[-1] += 1
        predict(motion_filter, time_s)

    monkeypatch.setattr(MotionFilter, "predict", counted)
    for _ in follow(recording, tracker, block=5):
        steps.append(0)

    assert sum(steps) > 80
    assert max(steps) <= FORGOTTEN_PERIODS * BINS_PER_PERIOD / LONGEST_STEP_BINS + 2


@pytest.mark.slow
def test_gap_longer_than_any_memory_starts_the_motion_anew() -> None:
    recording = swing(duration_s=20.0)
    later = replace(recording, time_s=recording.time_s + 10_000.0)
    tracker = new_tracker(recording.rig)
    list(follow(recording, tracker))

    estimates = list(follow(later, tracker))

    assert estimates[-1].angle_rad is not None
    assert np.median(np.abs(normalised_errors(later, estimates[-80:]))) < 2


@pytest.mark.slow
def test_impact_counts_as_an_outlier_and_leaves_the_angle_right() -> None:
    recording = swing(duration_s=30.0)
    struck = recording.force_g.copy()
    struck[1000:1003] += (0.6, -0.5, 0.4)
    tracker, undisturbed = new_tracker(recording.rig), new_tracker(recording.rig)

    estimates = list(follow(replace(recording, force_g=struck), tracker))

    list(follow(recording, undisturbed))
    assert 1 <= tracker.outliers - undisturbed.outliers <= 3
    after = [e for e in estimates if e.time_s > 20.0]
    assert all(e.angle_rad is not None for e in after)
    assert np.abs(normalised_errors(recording, after)).max() < 4


@pytest.mark.slow
def test_bins_with_clipped_samples_are_not_read() -> None:
    recording = swing(duration_s=20.0)

    def follow_clipped(reading_g: float) -> list[float | None]:
        tracker, angles = new_tracker(recording.rig), []
        for begin in range(0, len(recording.time_s), 10):
            time_s, force_g = recording.time_s[begin : begin + 10], recording.force_g[begin : begin + 10].copy()
            is_clipped = 600 <= begin < 630
            if is_clipped:
                force_g[:] = reading_g
            tracker.update(time_s, force_g, np.full(len(time_s), is_clipped))
            angles.append(tracker.estimate(float(time_s[-1])).angle_rad)
        return angles

    assert follow_clipped(2.0) == follow_clipped(-1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", case_seeds(2401, 6))
def test_start_in_the_middle_of_a_manoeuvre_gives_an_angle_within_one_period(seed: int) -> None:
    case = KINDS["mid_manoeuvre"](seed)
    crane = case.crane
    period_s = 2 * np.pi / crane.rate_rad_s
    recorded = record(case, period_s + 3)
    first = recorded.time_s < period_s + 2
    rig = replace(
        swing(duration_s=1.0).rig, length_m=case.believed_length_m, above_load_m=crane.above_load_m, length_u_rel=0.05
    )
    angle_rad = np.radians(np.interp(recorded.time_s, recorded.truth["time_s"], recorded.truth["angle_deg"]))
    recording = Recording(recorded.time_s[first], recorded.reading_g[first], angle_rad[first], rig)

    after = [e for e in follow(recording) if e.time_s > period_s]

    assert after
    assert all(e.angle_rad is not None for e in after)


def estimates_with_bins(recording: Recording, block: int) -> list[tuple[int, Array]]:
    """Number and state of the newest bin after each block that completed one."""
    tracker = new_tracker(recording.rig)
    found = []
    for begin in range(0, len(recording.time_s), block):
        time_s, force_g = recording.time_s[begin : begin + block], recording.force_g[begin : begin + block]
        if tracker.update(time_s, force_g):
            newest_s = present(tracker.leader.newest_s)
            newest = round(newest_s / tracker.bin_s - 0.5)
            e = tracker.estimate(newest_s)
            values = (e.angle_rad, e.u_rad, e.rate_rad_s, e.length_m, *e.probabilities)
            found.append((newest, np.array(values, dtype=float)))
    return found


@pytest.mark.slow
def test_same_samples_give_the_same_bits() -> None:
    recording = swing(duration_s=25.0, amplitude_deg=1.0, events=WORK)

    assert list(follow(recording)) == list(follow(recording))


@pytest.mark.slow
def test_size_of_the_blocks_does_not_matter() -> None:
    recording = swing(duration_s=20.0, amplitude_deg=1.0, events=WORK)
    one_by_one = dict(estimates_with_bins(recording, 1))

    for block in (7, 32, 500):
        in_blocks = estimates_with_bins(recording, block)

        assert in_blocks
        for newest, values in in_blocks:
            np.testing.assert_allclose(values, one_by_one[newest], rtol=1e-6, atol=1e-9)


def broken(recording: Recording, change: Callable[[Array, Array], None]) -> Recording:
    time_s, force_g = recording.time_s.copy(), recording.force_g.copy()
    change(time_s, force_g)
    return replace(recording, time_s=time_s, force_g=force_g)


def repeat_times(time_s: Array, _force_g: Array) -> None:
    time_s[800:840] = time_s[800]


def let_times_fall(time_s: Array, _force_g: Array) -> None:
    time_s[800:840] -= 2.0


def put_nan(_time_s: Array, force_g: Array) -> None:
    force_g[800:802] = np.nan
    force_g[840, 2] = np.inf


@pytest.mark.slow
@pytest.mark.parametrize("change", [repeat_times, let_times_fall, put_nan])
def test_bad_times_and_readings_are_survived(change: Callable[[Array, Array], None]) -> None:
    recording = swing(duration_s=30.0)
    tracker = new_tracker(recording.rig)

    estimates = list(follow(broken(recording, change), tracker))

    after = [e for e in estimates if e.time_s > 18.0]
    assert all(e.angle_rad is not None for e in after)
    assert np.abs(normalised_errors(recording, after)).max() < 4


def test_nothing_is_known_before_the_first_bin() -> None:
    estimate = new_tracker(swing(duration_s=1.0).rig).estimate(5.0)

    assert (estimate.state, estimate.angle_rad, estimate.u_rad) == ("unknown", None, None)
    assert estimate.reasons


def test_empty_block_completes_no_bin(free_swing: Recording) -> None:
    assert not new_tracker(free_swing.rig).update(np.zeros(0), np.zeros((0, 3)))


@pytest.mark.slow
def test_filter_that_has_lost_its_numbers_begins_anew(free_swing: Recording) -> None:
    tracker = new_tracker(free_swing.rig)
    half = len(free_swing.time_s) // 2
    tracker.update(free_swing.time_s[:half], free_swing.force_g[:half])
    tracker.leader.filter.mixture.covariance[:] *= -1e3

    next_bin = half + round(tracker.bin_s * RATE_HZ)
    tracker.update(free_swing.time_s[half:next_bin], free_swing.force_g[half:next_bin])
    lost = tracker.estimate(float(free_swing.time_s[next_bin - 1]))
    tracker.update(free_swing.time_s[next_bin:], free_swing.force_g[next_bin:])
    found = tracker.estimate(float(free_swing.time_s[-1]))

    assert (lost.state, lost.angle_rad) == ("unknown", None)
    assert abs(normalised_errors(free_swing, [found])[0]) < 4


@pytest.mark.slow
def test_hypothesis_that_is_long_excluded_stays_in_the_domain() -> None:
    """A drive of ten metres excludes gust and hoist so clearly that no transition revives them."""
    recording = swing(duration_s=30.0, amplitude_deg=2.0, noise_g=2e-5, events=[TrolleyMove(5.0, 10.0, 8.0, 2.0, 0.5)])
    candidate = new_candidate()

    for one in Binning(BIN_S).add(recording.time_s, recording.force_g):
        candidate.take(one, SIGMA_G)
        mixture = candidate.filter.mixture
        assert np.abs(mixture.state - mixture.state[mixture.weight.argmax()]).max() < 3
        assert np.linalg.eigvalsh(mixture.covariance).min() > -1e-12
