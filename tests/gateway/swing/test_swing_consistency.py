"""Segments of one recording were measured by one sensor: they must agree on its errors; a side pull may change."""

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from gateway.swing.data.bins import bin_samples
from gateway.swing.estimation.consistency import enforce_common_sensor_errors
from gateway.swing.estimation.hoist_tracking import FittedInterval
from gateway.swing.fit.priors import nominal_prior
from gateway.swing.offline import grow_window
from gateway.swing.rig import MountedHousing
from gateway.swing.uncertainty.peaks import largest_angle
from tests.gateway.swing.conftest import Recording, simulate
from tests.values import present

NOISE_G = np.full(3, 4e-4)
PULL_DEG = 3.0


def segment(
    recording: Recording,
    from_s: float,
    offset_g: ArrayLike = 0.0,
    zero_g_offset_u_g: float = 0.025,
) -> FittedInterval:
    """A recording fitted as if it began at `from_s` of a longer one."""
    rig = MountedHousing(
        length_m=recording.length_m,
        position_m=recording.position_m,
        zero_g_offset_u_g=(zero_g_offset_u_g,) * 3,
    )
    time_s = recording.time_s + from_s
    bins = bin_samples(time_s, recording.force_g + np.asarray(offset_g), 0.19, None)
    result = present(grow_window(bins, NOISE_G, nominal_prior(rig), float(time_s[0]), float(time_s[-1])))
    assert result.is_explained
    return FittedInterval(float(time_s[0]), float(time_s[-1]), result)


def leaning_g() -> NDArray[np.float64]:
    """What a steady pull toward x adds to the reading."""
    return np.array([np.sin(np.radians(PULL_DEG)), 0.0, 0.0])


@pytest.fixture(scope="module")
def segments() -> tuple[list[FittedInterval], Recording]:
    upright = simulate(amplitude_deg=8.0, duration_s=24.0)
    pulled = simulate(amplitude_deg=8.0, duration_s=12.0, lean_deg=PULL_DEG, lean_azimuth_deg=0.0, seed=2)
    return [segment(upright, 0.0), segment(upright, 24.0)], pulled


@pytest.mark.slow
def test_a_segment_with_other_sensor_errors_gets_an_interval_that_includes_the_angle_of_the_rest(
    segments: tuple[list[FittedInterval], Recording],
) -> None:
    rest, pulled = segments
    odd = segment(pulled, 48.0, offset_g=-leaning_g())  # reads on the mean as the rest does

    *_, held = found = enforce_common_sensor_errors([*rest, odd])[0]

    (angle_rad, u_rad), (_, before_rad) = (largest_angle(s.result.fit, s.result.uncertainty) for s in (held, odd))
    upright_rad, _ = largest_angle(rest[0].result.fit, rest[0].result.uncertainty)
    assert len(found) == 3
    assert angle_rad - upright_rad > 5 * before_rad
    assert angle_rad - upright_rad < 2 * u_rad


def test_the_reason_states_when_the_segment_was(segments: tuple[list[FittedInterval], Recording]) -> None:
    rest, pulled = segments

    _, (reason,) = enforce_common_sensor_errors([*rest, segment(pulled, 48.0, offset_g=-leaning_g())])

    assert "48-60 s" in reason
    assert "other sensor errors" in reason


def test_a_side_pull_that_begins_is_consistent(segments: tuple[list[FittedInterval], Recording]) -> None:
    rest, pulled = segments
    leaning = segment(pulled, 48.0)

    found, reasons = enforce_common_sensor_errors([*rest, leaning])

    assert reasons == ()
    before, after = (largest_angle(s.result.fit, s.result.uncertainty) for s in (leaning, found[-1]))
    assert after[0] == before[0]
    assert after[1] == pytest.approx(before[1], rel=0.2)


def test_segments_of_a_sensor_without_unknown_errors_are_unchanged(
    segments: tuple[list[FittedInterval], Recording],
) -> None:
    _, pulled = segments
    known = [segment(pulled, from_s, zero_g_offset_u_g=0.0) for from_s in (0.0, 12.0)]

    assert enforce_common_sensor_errors(known) == (known, ())


def test_a_single_segment_is_unchanged(segments: tuple[list[FittedInterval], Recording]) -> None:
    rest, _ = segments

    assert enforce_common_sensor_errors(rest[:1]) == (rest[:1], ())
