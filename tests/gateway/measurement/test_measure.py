"""The swing of a recording in parts, and its conditions."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from gateway.measurement.followed_recording import follow_recording
from gateway.measurement.measure import measure
from gateway.measurement.source import read_source
from gateway.measurement.swing import combine_parts
from gateway.swing.estimate import SwingEstimate, SwingPeak
from gateway.swing.rig import MountedHousing
from tests.gateway.measurement.simulated_source import source_of

HOUSING = MountedHousing(length_m=9.0, position_m=4.5, gravity_m_s2=9.80665)
RATE_HZ, NOISE_G, DURATION_S = 50.0, 0.0004, 40.0


def swinging(begin_s: float, phi_max_rad: float, u_rad: float = 0.001) -> SwingEstimate:
    return SwingEstimate(
        from_s=begin_s,
        to_s=begin_s + 40,
        swinging=True,
        phi_max_rad=phi_max_rad,
        u_rad=u_rad,
        coverage95_rad=(phi_max_rad - 2 * u_rad, phi_max_rad + 2 * u_rad),
        swings=(SwingPeak(time_s=begin_s + 3, phi_max_rad=phi_max_rad, u_rad=u_rad),),
    )


def resting(begin_s: float) -> SwingEstimate:
    return SwingEstimate(from_s=begin_s, to_s=begin_s + 40, swinging=False, coverage95_rad=(0.0, 0.002))


def unknown(begin_s: float, length_s: float) -> SwingEstimate:
    reasons = ("shorter than one swing",)
    return SwingEstimate(from_s=begin_s, to_s=begin_s + length_s, swinging=None, reasons=reasons)


def test_the_largest_part_gives_the_angle_and_every_part_its_swings() -> None:
    found = combine_parts([resting(0), swinging(1000, 0.05), swinging(2000, 0.02)], HOUSING)
    assert (found.swinging, found.phi_max_rad) == (True, 0.05)
    assert found.u_rad == pytest.approx(0.001)
    assert found.coverage95_rad == pytest.approx((0.048, 0.052))
    assert (found.from_s, found.to_s) == (0, 2040)
    assert [peak.time_s for peak in found.swings] == [1003, 2003]


def test_the_interval_covers_a_smaller_but_less_certain_part() -> None:
    found = combine_parts([swinging(0, 0.05, 0.001), swinging(1000, 0.049, 0.004)], HOUSING)
    assert found.coverage95_rad == pytest.approx((0.048, 0.057))
    assert found.u_rad == pytest.approx(0.0035)


def test_a_part_that_is_not_known_leaves_the_interval_open() -> None:
    found = combine_parts([swinging(0, 0.05), unknown(1000, 5.0)], HOUSING)
    assert (found.swinging, found.phi_max_rad, found.u_rad, found.coverage95_rad) == (True, 0.05, None, None)
    assert "uncertainty unknown at 1000-1005 s: shorter than one swing" in found.reasons
    assert combine_parts([resting(0), unknown(1000, 5.0)], HOUSING).swinging is None


def test_a_few_samples_between_gaps_leave_the_interval_as_it_is() -> None:
    found = combine_parts([swinging(0, 0.05), unknown(1000, 0.2)], HOUSING)
    assert found.coverage95_rad == pytest.approx((0.048, 0.052))
    assert combine_parts([resting(0), unknown(1000, 0.2)], HOUSING).swinging is False


@pytest.mark.slow
def test_swings_on_both_sides_of_ten_days_without_samples_are_measured() -> None:
    crane = Crane(
        length_m=9.0, position_m=4.5, gravity_m_s2=9.80665, motion=start_motion(math.radians(5.0), 0.0, 0.0, 0.0)
    )
    time_s = np.arange(0, DURATION_S, 1 / RATE_HZ)
    force_g = np.concatenate([crane.specific_force_m_s2(part) for part in np.array_split(time_s, 20)]) / 9.80665
    force_g = np.tile(force_g, (2, 1)) + np.random.default_rng(3).normal(0, NOISE_G, (2 * len(time_s), 3))
    time_s = np.concatenate([time_s, time_s + DURATION_S + 864_000.0])
    source = source_of(time_s, force_g, HOUSING, NOISE_G)
    swing = measure(source).swing
    assert swing.coverage95_rad is not None
    low_rad, high_rad = swing.coverage95_rad
    assert low_rad < math.radians(5.0) < high_rad < math.radians(5.2)
    half = len(time_s) // 2
    alone = measure(replace(source, recording=source.recording.part(0, half), force_g=force_g[:half]))
    assert len(swing.swings) >= 2 * len(alone.swing.swings) > 4
    assert swing.reasons[0] == "estimated in 2 parts between long gaps"


def test_the_most_frequent_reason_is_said_not_that_of_the_first_window(tmp_path: Path) -> None:
    """The first windows have less than a second of data; the others are unknown because no rig is known."""
    time_s = np.arange(3000) / 100
    angle = np.radians(8) * np.cos(1.5 * time_s)
    force_g = np.column_stack([-0.25 * np.sin(angle), np.zeros(3000), np.cos(angle)])
    force_g += np.random.default_rng(1).normal(0, 1e-3, force_g.shape)
    path = tmp_path / "log.csv"
    header = "time_s,ax_g,ay_g,az_g"
    np.savetxt(path, np.column_stack([time_s, force_g]), delimiter=",", header=header, comments="")
    summary = follow_recording(read_source([path])).conditions
    assert summary.verdict == "unknown"
    assert summary.reasons != ("less than a second of data",)


def test_windows_that_are_too_short_do_not_count_beside_others(tmp_path: Path) -> None:
    """A recording of 2.6 s has five windows, the first of which is too short."""
    path = tmp_path / "log.csv"
    rows = "".join(f"{n / 50:.2f},{0.001 * (n % 3)},{0.001 * (n % 2)},1\n" for n in range(130))
    path.write_text("time_s,ax_g,ay_g,az_g\n" + rows)
    summary = follow_recording(read_source([path])).conditions
    assert summary.reasons != ("less than a second of data",)
    assert sum(summary.windows.values()) == 4
