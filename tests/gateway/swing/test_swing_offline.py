"""The estimate of whole recordings: planted values are found, and nothing unknown is claimed."""

import gzip
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.pipeline.rig import UNSTATED_GRAVITY_U_REL, Rig
from gateway.swing.estimate import SwingEstimate
from gateway.swing.offline import estimate_swing
from gateway.swing.rig import MountedHousing
from tests.gateway.swing.conftest import Recording, simulate
from tests.values import present

DATA = Path(__file__).parents[2] / "data" / "swings"


def measured(
    recording: Recording,
    *,
    length_error: float = 1.0,
    noise_g: float | None = None,
    force_g: NDArray[np.float64] | None = None,
    **rig: Any,
) -> SwingEstimate:
    housing = MountedHousing(length_m=recording.length_m * length_error, position_m=recording.position_m, **rig)
    return estimate_swing(
        recording.time_s, recording.force_g if force_g is None else force_g, rig=housing, noise_g=noise_g
    )


def sigmas(estimate: SwingEstimate, recording: Recording) -> float:
    return abs(present(estimate.phi_max_rad) - recording.phi_max_rad) / present(estimate.u_rad)


def test_a_rope_by_the_period_is_as_uncertain_as_gravity() -> None:
    recording = simulate()
    stated, unstated = (measured(recording, gravity_u_rel=u_rel) for u_rel in (0.0, UNSTATED_GRAVITY_U_REL))
    assert present(stated.length_u_m) < 1e-3 * recording.length_m
    assert present(unstated.length_u_m) > UNSTATED_GRAVITY_U_REL * recording.length_m
    assert unstated.coverage95_rad == stated.coverage95_rad
    rig = {"rope": {"length_m": 9.0}, "housing": {"position_m": 4.5}}
    assert Rig.model_validate(rig).mounted_housing().gravity_u_rel == UNSTATED_GRAVITY_U_REL
    assert Rig.model_validate({**rig, "site": {"gravity_m_s2": 9.81}}).mounted_housing().gravity_u_rel == 0


@pytest.mark.slow
@settings(max_examples=12, derandomize=True, phases=[Phase.explicit, Phase.generate])
@given(
    rho=st.floats(0, 1),
    amplitude_deg=st.floats(4, 30),
    ellipticity=st.floats(-0.9, 0.9),
    azimuth_deg=st.floats(-180, 180),
    length_m=st.floats(4, 40),
    length_error=st.floats(0.85, 1.2),
)
@example(rho=0.0, amplitude_deg=30, ellipticity=0.0, azimuth_deg=0, length_m=4, length_error=1.2)
@example(rho=1.0, amplitude_deg=8, ellipticity=0.0, azimuth_deg=60, length_m=12, length_error=0.9)
@example(rho=0.5, amplitude_deg=15, ellipticity=1.0, azimuth_deg=0, length_m=9, length_error=1.1)
def test_any_swing_is_estimated_within_its_uncertainty(
    rho: float, amplitude_deg: float, ellipticity: float, azimuth_deg: float, length_m: float, length_error: float
) -> None:
    recording = simulate(
        rho=rho,
        amplitude_deg=amplitude_deg,
        ellipticity=ellipticity,
        azimuth_deg=azimuth_deg,
        length_m=length_m,
        duration_s=4 * 2 * math.pi * math.sqrt(length_m / 9.8),
        rate_hz=25.0,
    )

    estimate = measured(recording, length_error=length_error)

    assert estimate.swinging
    assert sigmas(estimate, recording) < 4
    assert present(estimate.u_rad) < 0.03 * recording.phi_max_rad
    assert estimate.length_m == pytest.approx(length_m, rel=0.02)
    assert present(estimate.coverage95_rad)[0] < present(estimate.phi_max_rad) < present(estimate.coverage95_rad)[1]


@pytest.mark.slow
def test_every_quantity_of_the_estimate_is_the_planted_one() -> None:
    recording = simulate(
        rho=0.3, amplitude_deg=6, ellipticity=0.3, azimuth_deg=-35, lean_deg=2, damping_ratio=0.004, duration_s=60
    )

    estimate = measured(recording, length_error=1.15)

    assert sigmas(estimate, recording) < 4
    assert np.degrees(present(estimate.lean_rad)) == pytest.approx(2.0, abs=0.01)
    assert np.degrees(present(estimate.lean_azimuth_rad)) == pytest.approx(
        70.0, abs=8
    )  # a conical swing turns the housing
    assert estimate.length_m == pytest.approx(9.0, rel=2e-3)
    assert estimate.period_s == pytest.approx(2 * np.pi * np.sqrt(9.0 / 9.80665), rel=1e-3)
    assert estimate.damping_ratio == pytest.approx(0.004, rel=0.05)
    assert estimate.minor_phi_max_rad == pytest.approx(0.3 * np.radians(6) * np.exp(-0.004 * 60 * 1.044), rel=0.1)
    assert len(estimate.swings) == 9
    assert estimate.reduced_chi_square == pytest.approx(1.0, abs=0.15)
    assert estimate.reasons == ()
    for swing in estimate.swings:
        near = np.abs(recording.time_s - swing.time_s) < 0.6 * present(estimate.period_s)
        assert swing.phi_max_rad < recording.angle_rad[near].max() + 4 * swing.u_rad


@pytest.mark.slow
@pytest.mark.parametrize("azimuth_deg", [-60.0, 20.0, 85.0])
def test_azimuth_of_a_planar_swing(azimuth_deg: float) -> None:
    estimate = measured(simulate(azimuth_deg=azimuth_deg, duration_s=20))

    assert np.degrees(present(estimate.azimuth_rad)) == pytest.approx(azimuth_deg, abs=0.5)
    assert present(estimate.minor_phi_max_rad) < 0.01 * present(estimate.phi_max_rad)


@pytest.mark.parametrize(
    ("name", "length_m", "position_m", "noise_g", "true_deg", "period_s"),
    [
        ("swing_001", 8.9285, 4.0254, 0.0004, 7.548203523, 5.692937),
        ("swing_019", 14.2867, 14.2494, 0.0025, 6.668324790, 7.577650),
    ],
)
def test_recordings_of_an_independent_engine(
    name: str, length_m: float, position_m: float, noise_g: float, true_deg: float, period_s: float
) -> None:
    with gzip.open(DATA / f"{name}.csv.gz", "rt") as file:
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
    rig = MountedHousing(length_m=length_m, position_m=position_m)

    estimate = estimate_swing(rows[:, 0], rows[:, 1:4], rig=rig, noise_g=noise_g)

    assert np.degrees(present(estimate.phi_max_rad)) == pytest.approx(
        true_deg, abs=3 * np.degrees(present(estimate.u_rad))
    )
    assert np.degrees(present(estimate.u_rad)) < 0.08
    assert estimate.period_s == pytest.approx(period_s, rel=2e-3)


@pytest.mark.slow
def test_missing_uneven_and_unusable_samples_leave_the_estimate_correct() -> None:
    recording = simulate(duration_s=40)
    kept = np.random.default_rng(5).random(len(recording.time_s)) > 0.3
    kept[700:830] = False
    force_g = recording.force_g.copy()
    force_g[::50, 1] = np.nan
    rig = MountedHousing(length_m=9, position_m=recording.position_m)

    estimate = estimate_swing(recording.time_s[kept], force_g[kept], rig=rig)

    assert sigmas(estimate, recording) < 4


@pytest.mark.slow
def test_lone_spikes_are_left_out_and_counted() -> None:
    recording = simulate(duration_s=40)
    force_g = recording.force_g.copy()
    force_g[[0, 555, 1200]] += [0.2, -0.3, 0.1]

    estimate = measured(recording, force_g=force_g)

    assert sigmas(estimate, recording) < 4
    assert "spikes left out: 3 samples" in estimate.reasons


@pytest.mark.slow
def test_stated_uncertainty_of_rig_and_sensor_widens_the_interval_and_covers() -> None:
    """A wrong position and offset that the rig admits to: less sure, and still right."""
    recording = simulate(rho=0.5, duration_s=60)
    force_g = recording.force_g + np.array([0.0, 0.0, 0.01])
    sure = measured(recording)

    rig = MountedHousing(
        length_m=9, position_m=recording.position_m + 0.4, position_u_m=0.5, zero_g_offset_u_g=(0, 0, 0.01)
    )
    unsure = estimate_swing(recording.time_s, force_g, rig=rig)

    assert sigmas(unsure, recording) < 3
    assert present(unsure.u_rad) > 1.8 * present(sure.u_rad)
    assert unsure.reasons == ()


@pytest.mark.slow
def test_uncertainty_of_the_offset_is_part_of_that_of_the_lean() -> None:
    recording = simulate(duration_s=30)

    estimate = measured(recording, zero_g_offset_u_g=(0.005, 0.005, 0.0))

    assert present(estimate.lean_u_rad) > 5 * present(measured(recording).lean_u_rad)


@pytest.mark.slow
def test_a_housing_known_from_the_load_has_its_place_by_the_measured_length() -> None:
    recording = simulate(rho=0.6, duration_s=40)
    above_m = recording.length_m - recording.position_m

    estimate = estimate_swing(
        recording.time_s, recording.force_g, rig=MountedHousing(length_m=7.8, above_load_m=above_m)
    )

    assert sigmas(estimate, recording) < 4
    assert estimate.length_m == pytest.approx(recording.length_m, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "reported"),
    [
        (lambda f: f @ np.array([[1, 0, 0.02], [0, 1, 0], [0, 0.03, 1]]).T, "into"),
        (lambda f: f + np.array([0.0, 0.0, 0.02]), "rig and sensor as stated do not explain the data"),
    ],
)
def test_unstated_errors_are_found_reported_and_part_of_the_uncertainty(
    spoil: Callable[..., Any], reported: str
) -> None:
    recording = simulate(rho=0.4, ellipticity=0.5, duration_s=60)

    estimate = measured(recording, force_g=spoil(recording.force_g))

    assert abs(present(estimate.phi_max_rad) - recording.phi_max_rad) < 3 * present(estimate.u_rad)
    assert present(estimate.u_rad) < 0.03 * present(estimate.phi_max_rad)
    assert any(reported in reason for reason in estimate.reasons)


@pytest.mark.slow
@pytest.mark.parametrize("stated_rho", [1.1, 1.2, 1.3])
def test_a_housing_stated_below_its_load_gives_no_angle_that_is_wrong(stated_rho: float) -> None:
    recording = simulate(
        amplitude_deg=12.0, length_m=2.0, rho=0.8, damping_ratio=0.0, duration_s=60.0, noise_g=1e-3, azimuth_deg=0.0
    )
    rig = MountedHousing(
        length_m=2.0, position_m=2.0 * stated_rho, position_u_m=0.001, beside_u_m=0.015, mount_u_rad=None
    )
    estimate = estimate_swing(recording.time_s, recording.force_g, rig=rig)
    assert estimate.swinging is None, (
        "an opposite swing of 10.5 deg with a housing below the load explains this as well"
    )
    assert estimate.coverage95_rad is None


@pytest.mark.slow
def test_a_wrong_position_is_reported() -> None:
    recording = simulate(rho=0.3, duration_s=60)

    estimate = estimate_swing(
        recording.time_s, recording.force_g, rig=MountedHousing(length_m=9, position_m=recording.position_m + 1.2)
    )

    assert abs(present(estimate.phi_max_rad) - recording.phi_max_rad) < 3 * present(estimate.u_rad)
    assert any("housing -1." in reason for reason in estimate.reasons)


@pytest.mark.slow
def test_a_load_at_rest_has_an_upper_bound_that_holds() -> None:
    still = measured(simulate(amplitude_deg=0.0, lean_deg=3, lean_azimuth_deg=-50, duration_s=40))

    assert still.swinging is False
    assert (still.phi_max_rad, still.u_rad, still.swings) == (None, None, ())
    assert np.degrees(present(still.lean_rad)) == pytest.approx(3.0, abs=0.005)
    assert np.degrees(present(still.lean_azimuth_rad)) == pytest.approx(-50, abs=0.1)
    low, high = np.degrees(present(still.coverage95_rad))
    assert 2.9 < low < 3.0 < high < 3.1


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_a_swing_hidden_by_noise_is_below_the_upper_bound(rho: float) -> None:
    recording = simulate(rho=rho, amplitude_deg=0.004, noise_g=2e-3, duration_s=40)

    hidden = measured(recording)

    assert hidden.swinging is False
    assert recording.phi_max_rad < present(hidden.coverage95_rad)[1] < np.radians(3)


@pytest.mark.slow
def test_irregular_motion_is_bounded_by_its_largest_deviation() -> None:
    recording = simulate(amplitude_deg=0.0, noise_g=1e-5, duration_s=40)
    steps = 1e-4 * np.random.default_rng(6).normal(size=recording.force_g.shape)
    fading = 0.98 ** np.arange(400)
    wander = np.stack([np.convolve(axis, fading)[: len(steps)] for axis in steps.T], axis=1)

    restless = measured(recording, force_g=recording.force_g + wander)

    assert restless.swinging is False
    assert np.radians(0.05) < present(restless.coverage95_rad)[1] < np.radians(1)
    assert restless.reasons == ("motion without a pendulum's period",)


@pytest.mark.slow
def test_a_push_separates_two_segments() -> None:
    def push(time_s: float) -> tuple[float, float, float]:
        return (0.8, 0.4, 0.0) if 40 <= time_s < 40.3 else (0.0, 0.0, 0.0)

    recording = simulate(amplitude_deg=4, duration_s=90, push=push)

    estimate = measured(recording)

    assert "fitted in" in estimate.reasons[0]
    assert abs(present(estimate.phi_max_rad) - recording.phi_max_rad) < 3 * present(estimate.u_rad)


@pytest.mark.slow
def test_a_long_drive_leaves_no_interval() -> None:
    def drive(time_s: float) -> tuple[float, float, float]:
        return (0.25 * np.sin(1.9 * time_s), 0.1, 0.0) if 30 <= time_s < 50 else (0.0, 0.0, 0.0)

    estimate = measured(simulate(amplitude_deg=4, duration_s=80, push=drive))

    assert (estimate.u_rad, estimate.coverage95_rad) == (None, None)
    assert any("largest angle unknown" in reason for reason in estimate.reasons)


@pytest.mark.slow
def test_a_short_drive_at_the_end_leaves_no_interval() -> None:
    """Less than half a period, as where the gateway ended in the accident: no swing behind it shows what it has begun."""
    recording = simulate(
        amplitude_deg=2, duration_s=42, push=lambda time_s: (0.8, 0.0, 0.0) if time_s >= 39.4 else (0.0, 0.0, 0.0)
    )

    estimate = measured(recording)

    assert np.degrees(recording.phi_max_rad) > 4
    assert estimate.coverage95_rad is None
    assert any("largest angle unknown, at" in reason and reason.endswith("-42 s") for reason in estimate.reasons)


@pytest.mark.slow
def test_data_of_no_pendulum_get_no_angle() -> None:
    recording = simulate(duration_s=40)
    wander = np.cumsum(np.random.default_rng(2).normal(scale=2e-3, size=recording.force_g.shape), axis=0)

    estimate = measured(recording, force_g=wander - wander.mean(axis=0) + np.array([0.0, 0.0, 1.0]))

    assert estimate.swinging is not False
    assert estimate.coverage95_rad is None
    assert estimate.reasons


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [lambda f: f * [0, 1, 1], lambda f: np.minimum(f, [9, 9, 1.004]), lambda f: f * 9.81])
def test_a_broken_sensor_gets_a_reason_and_no_angle(spoil: Callable[..., Any]) -> None:
    recording = simulate(rho=0.8, duration_s=40)

    estimate = measured(recording, force_g=spoil(recording.force_g))

    assert (estimate.swinging, estimate.phi_max_rad, estimate.coverage95_rad) == (None, None, None)
    assert len(estimate.reasons) == 1


def test_too_short_or_empty_is_unknown() -> None:
    recording = simulate(duration_s=3)

    assert measured(recording).reasons == ("shorter than one swing",)
    empty = estimate_swing(np.empty(0), np.empty((0, 3)), rig=MountedHousing(length_m=9, position_m=1))
    assert (empty.swinging, empty.reasons) == (None, ("no samples",))


def test_wrong_shapes_and_falling_times_are_refused() -> None:
    rig = MountedHousing(length_m=9, position_m=1)
    with pytest.raises(ValueError, match=r"forces \(n, 3\)"):
        estimate_swing(np.zeros(3), np.zeros((3, 2)), rig=rig)
    with pytest.raises(ValueError, match="fall"):
        estimate_swing(np.array([0.0, 2.0, 1.0]), np.zeros((3, 3)), rig=rig)


@pytest.mark.parametrize(
    "wrong",
    [
        {"length_m": 0, "position_m": 1},
        {"length_m": 5},
        {"length_m": 5, "position_m": 1, "above_load_m": 4},
        {"length_m": 5, "position_m": -1},
        {"length_m": 5, "position_m": 1, "length_u_rel": 1.5},
        {"length_m": 5, "position_m": 1, "scale_u": (0.0, -0.1, 0.0)},
    ],
)
def test_an_impossible_rig_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"must|give"):
        MountedHousing(**wrong)
