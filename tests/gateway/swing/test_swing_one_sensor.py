"""Pieces of one recording were read by one sensor: what they say of its errors must agree; a side pull may change."""

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from gateway.swing import MountedHousing
from gateway.swing.data.bins import bin_samples
from gateway.swing.estimation.cross_segment_consistency import enforce_common_sensor_errors
from gateway.swing.estimation.hoist_tracking import FittedInterval
from gateway.swing.fit.priors import nominal_prior
from gateway.swing.offline import grow
from gateway.swing.uncertainty.peaks import largest_angle
from tests.gateway.swing.conftest import Recording, Simulate
from tests.values import present

NOISE_G = np.full(3, 4e-4)
PULL_DEG = 3.0


def piece(
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
    finding = present(grow(bins, NOISE_G, nominal_prior(rig), float(time_s[0]), float(time_s[-1])))
    assert finding.plain
    return FittedInterval(float(time_s[0]), float(time_s[-1]), finding)


def leaning_g() -> NDArray[np.float64]:
    """What a steady pull toward x adds to the reading."""
    return np.array([np.sin(np.radians(PULL_DEG)), 0.0, 0.0])


@pytest.fixture(scope="module")
def pieces(simulated: Simulate) -> tuple[list[FittedInterval], Recording]:
    upright = simulated(amplitude_deg=8.0, duration_s=24.0)
    pulled = simulated(amplitude_deg=8.0, duration_s=12.0, lean_deg=PULL_DEG, lean_azimuth_deg=0.0, seed=2)
    return [piece(upright, 0.0), piece(upright, 24.0)], pulled


@pytest.mark.slow
def test_a_piece_with_another_sensor_is_widened_to_the_angle_with_the_sensor_of_the_rest(
    pieces: tuple[list[FittedInterval], Recording],
) -> None:
    rest, pulled = pieces
    odd = piece(pulled, 48.0, offset_g=-leaning_g())  # reads on the mean as the rest does

    *_, held = found = enforce_common_sensor_errors([*rest, odd])[0]

    (angle_rad, u_rad), (_, before_rad) = (largest_angle(p.finding.fit, p.finding.claim) for p in (held, odd))
    upright_rad, _ = largest_angle(rest[0].finding.fit, rest[0].finding.claim)
    assert len(found) == 3
    assert angle_rad - upright_rad > 5 * before_rad
    assert angle_rad - upright_rad < 2 * u_rad


def test_it_is_named(pieces: tuple[list[FittedInterval], Recording]) -> None:
    rest, pulled = pieces

    _, (reason,) = enforce_common_sensor_errors([*rest, piece(pulled, 48.0, offset_g=-leaning_g())])

    assert "48-60 s" in reason
    assert "another sensor" in reason


def test_a_side_pull_that_begins_is_not_held_to_the_lean_before(pieces: tuple[list[FittedInterval], Recording]) -> None:
    rest, pulled = pieces
    leaning = piece(pulled, 48.0)

    found, reasons = enforce_common_sensor_errors([*rest, leaning])

    assert reasons == ()
    before, after = (largest_angle(p.finding.fit, p.finding.claim) for p in (leaning, found[-1]))
    assert after[0] == before[0]
    assert after[1] == pytest.approx(before[1], rel=0.2)


def test_pieces_of_a_sensor_without_unknown_errors_stay_as_they_are(
    pieces: tuple[list[FittedInterval], Recording],
) -> None:
    _, pulled = pieces
    known = [piece(pulled, from_s, zero_g_offset_u_g=0.0) for from_s in (0.0, 12.0)]

    assert enforce_common_sensor_errors(known) == (known, ())


def test_one_piece_has_nothing_to_agree_with(pieces: tuple[list[FittedInterval], Recording]) -> None:
    rest, _ = pieces

    assert enforce_common_sensor_errors(rest[:1]) == (rest[:1], ())
