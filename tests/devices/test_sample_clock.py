"""Sample times from counts: planted rates and delays come back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from devices.sample_clock import N_BUCKETS, SampleClock, slope_below
from tests.values import present

START_NS = 1_700_000_000_000_000_000


class Part:
    """Makes samples at a planted rate; `drift` is the relative change of the period per second."""

    def __init__(self, rate_hz: float, seconds: float, *, seed: int = 0, drift: float = 0.0) -> None:
        self.random = np.random.default_rng(seed)
        self.period_ns = 1e9 / rate_hz
        nominal_ns = self.period_ns * np.arange(int(rate_hz * seconds)) + self.random.uniform(0, self.period_ns)
        self.made_ns = START_NS + np.rint(nominal_ns * (1 + drift * nominal_ns / 2e9)).astype(np.int64)

    def seen_late(self, clock: SampleClock, block: int, delay_s: float) -> NDArray[np.int64]:
        """Blocks of a fixed length that arrive up to `delay_s` after their last sample (a radio)."""
        ends = range(block, len(self.made_ns) + 1, block)
        delays_ns = self.random.uniform(0, delay_s * 1e9, len(ends)).astype(np.int64)
        reads_ns = np.maximum.accumulate(self.made_ns[np.array(ends) - 1] + delays_ns)
        return np.concatenate([clock.stamp(block, int(read_ns)) for read_ns in reads_ns])

    def drained_late(self, clock: SampleClock, block_s: float, delay_s: float) -> NDArray[np.int64]:
        """All that is there is taken, by a host that wakes up to `delay_s` late (a FIFO)."""
        times: list[NDArray[np.int64]] = []
        taken, wake_ns = 0, START_NS
        while True:
            wake_ns += round(block_s * 1e9 + self.random.uniform(0, delay_s * 1e9))
            there = int(np.searchsorted(self.made_ns, wake_ns, side="right"))
            if there == len(self.made_ns):
                return np.concatenate(times)
            times.append(clock.stamp(there - taken, wake_ns))
            taken = there


def error_ms(times_ns: NDArray[np.int64], made_ns: NDArray[np.int64], after_s: float = 0.0) -> tuple[float, float]:
    """Constant part and rms of the rest, of the samples made `after_s` or later."""
    error = (times_ns - made_ns[: len(times_ns)])[made_ns[: len(times_ns)] >= made_ns[0] + after_s * 1e9] / 1e6
    return float(error.mean()), float(error.std())


@pytest.mark.slow
@settings(max_examples=12)
@given(
    rate_error=st.floats(-0.05, 0.05),
    delay_s=st.floats(0.004, 0.02),  # a host in step with the part cannot tell ages apart: see Adxl355
    seed=st.integers(0, 1000),
    rate_and_block=st.sampled_from([(125.0, 7), (125.0, 16), (1000.0, 32), (62.5, 4)]),
)
def test_ten_minutes_of_a_fifo_that_is_drained_late(
    rate_error: float, delay_s: float, seed: int, rate_and_block: tuple[float, int]
) -> None:
    rate_hz, block = rate_and_block
    part = Part(rate_hz * (1 + rate_error), 600 if rate_hz < 500 else 120, seed=seed)
    clock = SampleClock(rate_hz, usual_delay_s=1 / rate_hz)
    times_ns = part.drained_late(clock, block / rate_hz, delay_s)
    assert np.all(np.diff(times_ns) > 0)
    constant_ms, rms_ms = error_ms(times_ns, part.made_ns, after_s=10)
    assert -0.2 < constant_ms < 1e3 / rate_hz  # the level bounds the age: never later than a period
    assert rms_ms < 0.2 if rate_hz >= 125 else rms_ms < 0.4
    assert error_ms(times_ns, part.made_ns)[1] < (0.5 if rate_hz >= 125 else 1.5)  # with the first ten seconds


@pytest.mark.slow
@settings(max_examples=12)
@given(
    rate_error=st.floats(-0.05, 0.05),
    seed=st.integers(0, 1000),
    rate_and_block=st.sampled_from([(100.0, 4), (1000.0, 32)]),
)
def test_ten_minutes_of_blocks_that_arrive_up_to_20_ms_late(
    rate_error: float, seed: int, rate_and_block: tuple[float, int]
) -> None:
    rate_hz, block = rate_and_block
    part = Part(rate_hz * (1 + rate_error), 600 if rate_hz < 500 else 120, seed=seed)
    clock = SampleClock(rate_hz)
    times_ns = part.seen_late(clock, block, 0.02)
    assert np.all(np.diff(times_ns) > 0)
    constant_ms, rms_ms = error_ms(times_ns, part.made_ns, after_s=10)
    assert abs(constant_ms) < 0.2
    assert rms_ms < 0.2


def test_times_of_reading_would_fail_the_same_limit() -> None:
    part = Part(131.25, 60)
    late_ms = part.random.uniform(0, 20, len(part.made_ns))
    assert error_ms(part.made_ns + (late_ms * 1e6).astype(np.int64), part.made_ns)[1] > 5


@pytest.mark.slow
def test_the_rate_is_measured_with_an_uncertainty_that_holds() -> None:
    within = 0
    for seed in range(40):
        part = Part(1000 * (1 + 0.05 * math.sin(seed)), 30, seed=seed)
        clock = SampleClock(1000)
        part.seen_late(clock, 32, 0.02)
        u_hz = present(clock.measured_rate_u_hz)
        assert u_hz < 0.05
        within += abs(present(clock.measured_rate_hz) - 1e9 / part.period_ns) < 2 * u_hz
    assert within >= 36


def test_the_rate_is_unknown_until_it_was_measured() -> None:
    clock = SampleClock(125)
    assert clock.measured_rate_hz is None
    assert clock.measured_rate_u_hz is None
    assert clock.due_ns(1) is None
    clock.stamp(8, START_NS)
    assert clock.measured_rate_hz is None


def test_the_first_block_ends_at_its_reading_and_has_the_nominal_rate() -> None:
    assert SampleClock(125).stamp(3, START_NS).tolist() == [START_NS - 16_000_000, START_NS - 8_000_000, START_NS]


def test_times_increase_when_the_first_reading_was_late() -> None:
    clock = SampleClock(1000)
    first_ns = clock.stamp(8, START_NS + 19_000_000)
    second_ns = clock.stamp(8, START_NS + 8_000_000)  # eight periods after the first was made
    assert np.all(np.diff(np.concatenate([first_ns, second_ns])) >= 400_000)
    later_ns = np.concatenate([clock.stamp(8, START_NS + k * 8_000_000) for k in range(2, 40)])
    assert later_ns[-1] == pytest.approx(START_NS + 39 * 8_000_000, abs=200_000)


def test_samples_that_remain_in_the_part_are_newer() -> None:
    assert SampleClock(125).stamp(1, START_NS, behind=2).tolist() == [START_NS - 16_000_000]


def test_no_sample_gives_no_observation() -> None:
    clock = SampleClock(125)
    assert len(clock.stamp(0, START_NS)) == 0
    assert clock.due_ns(1) is None


def test_an_observation_without_samples_predicts_the_next_ones() -> None:
    clock = SampleClock(125)
    assert len(clock.stamp(0, START_NS, behind=4)) == 0
    assert clock.due_ns(4) == START_NS
    assert clock.due_ns(6) == START_NS + 16_000_000


def test_lost_samples_keep_their_place() -> None:
    part = Part(125, 60)
    whole, holed = SampleClock(125), SampleClock(125)
    for first in range(0, len(part.made_ns) - 8, 8):
        read_ns = int(part.made_ns[first + 7]) + 1_000_000
        times_ns = whole.stamp(8, read_ns)
        assert holed.stamp(5, read_ns, lost=3).tolist() == pytest.approx(times_ns[3:].tolist(), abs=2)


def test_a_restart_keeps_the_rate_and_increasing_times() -> None:
    part = Part(1050, 30)
    clock = SampleClock(1000, usual_delay_s=0.001)
    times_ns = part.seen_late(clock, 32, 0.001)
    rate_hz = present(clock.measured_rate_hz)
    clock.restart()
    assert clock.measured_rate_hz == rate_hz
    after_ns = clock.stamp(32, int(times_ns[-1]) + 5_000_000)
    assert after_ns[0] > times_ns[-1]
    assert np.all(np.diff(after_ns) > 0)
    clock.restart()
    later_ns = clock.stamp(32, int(times_ns[-1]) + 5_000_000_000)
    assert np.diff(later_ns).mean() == pytest.approx(1e9 / rate_hz, rel=1e-6)  # a jump, not a stretch


@pytest.mark.slow
def test_rate_that_drifts_with_temperature_is_followed() -> None:
    part = Part(1000, 300, drift=4e-7)  # 24 ppm a minute, over five minutes
    clock = SampleClock(1000, usual_delay_s=0.001)
    times_ns = part.seen_late(clock, 32, 0.001)
    assert error_ms(times_ns, part.made_ns, after_s=10)[1] < 0.2


def test_samples_lost_without_a_count_are_detected() -> None:
    part = Part(125, 120)
    clock = SampleClock(125)
    kept = np.delete(part.made_ns, np.arange(7000, 7100))
    times_ns = np.concatenate([clock.stamp(10, int(kept[i + 9]) + 500_000) for i in range(0, len(kept) - 10, 10)])
    error = (times_ns - kept[: len(times_ns)]) / 1e6
    assert clock.relearned == 1
    assert abs(error[7150:]).max() < 1.0
    assert np.all(np.diff(times_ns) > 0)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [500, 800, 1200, 2000])
def test_a_rate_far_from_the_nominal_one_is_measured(rate_hz: int) -> None:
    part = Part(rate_hz, 60)
    clock = SampleClock(1000)
    times_ns = part.seen_late(clock, 32, 0.02)
    assert clock.measured_rate_hz == pytest.approx(rate_hz, abs=0.05)
    assert error_ms(times_ns, part.made_ns, after_s=10)[1] < 0.3


def test_a_single_wrong_observation_has_no_effect() -> None:
    part = Part(125, 60)
    clock = SampleClock(125)
    for i in range(0, 6000, 10):
        clock.stamp(10, int(part.made_ns[i + 9]) + 500_000)
    rate_hz, due_ns = clock.measured_rate_hz, clock.due_ns(1)
    clock.stamp(0, int(part.made_ns[6000]), behind=64)
    clock.stamp(0, int(part.made_ns[6000]) + 700_000_000, behind=1)
    assert (clock.measured_rate_hz, clock.due_ns(1)) == (rate_hz, due_ns)
    assert clock.relearned == 0


@pytest.mark.slow
def test_memory_and_precision_are_bounded_after_weeks() -> None:
    clock = SampleClock(1000, usual_delay_s=0.001)
    clock.stamp(1, START_NS, lost=12 * 7 * 86400 * 1000)
    part = Part(1000, 200)
    times_ns = part.seen_late(clock, 32, 0.001)
    assert len(clock._window._observations) <= N_BUCKETS + 1
    assert error_ms(times_ns, part.made_ns, after_s=10)[1] < 0.02


def test_slope_below_is_that_of_the_best_line_below() -> None:
    random = np.random.default_rng(3)
    x = np.arange(40.0)
    y = 2 * x + random.exponential(1.0, 40)
    slope = slope_below(list(zip(x.tolist(), y.tolist(), strict=True)))

    def heights(tried: float) -> float:
        return float((y - tried * x - (y - tried * x).min()).sum())

    assert heights(slope) <= min(heights(slope + change) for change in np.linspace(-0.2, 0.2, 401)) + 1e-9
