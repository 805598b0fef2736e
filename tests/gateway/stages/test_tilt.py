"""Static tilt against geometry over the whole sphere."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.stages.tilt import (
    axial_tilt,
    axial_tilt_uncertainty,
    fused_tilt,
    lean_direction,
    plain_tilt,
    roll_about_x,
    roll_from_angles,
)

turns = st.floats(-179.9, 179.9)


def pitched(angle_deg: float) -> NDArray[np.float64]:
    return np.array([math.sin(math.radians(angle_deg)), 0.0, math.cos(math.radians(angle_deg))])


def rolled(angle_deg: float) -> NDArray[np.float64]:
    return np.array([0.0, math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))])


@pytest.mark.slow
@pytest.mark.parametrize("critical_value", [1.0, 4.0, 8.0])
@given(angle_deg=turns)
def test_pitch_and_roll_cover_the_full_range(critical_value: float, angle_deg: float) -> None:
    for m, which in ((pitched(angle_deg), "pitch_rad"), (rolled(angle_deg), "roll_rad")):
        found_deg = math.degrees(getattr(fused_tilt(m, critical_value), which))
        assert found_deg == pytest.approx(angle_deg, abs=1e-5)


def test_angles_are_unfolded_after_the_arccosine() -> None:
    """The printed step list (001, steps 16 and 23) returns 80 degrees here."""
    assert math.degrees(fused_tilt(pitched(100.0)).pitch_rad) == pytest.approx(100.0)
    assert math.degrees(fused_tilt(rolled(-100.0)).roll_rad) == pytest.approx(-100.0)


@pytest.mark.parametrize("azimuth_rad", np.arange(-3.0, 3.1, 0.75).tolist())
@pytest.mark.parametrize("tilt_rad", [0.0, 0.01, 0.4, 1.0, 1.5])
def test_both_branches_take_the_geometric_sum_of_the_other_two_axes(tilt_rad: float, azimuth_rad: float) -> None:
    """Łuczak n.d., eq. 16 and 17: turned about two axes at once, the sine of an angle is the component of its own axis."""
    across = math.sin(tilt_rad)
    m = np.array([across * math.cos(azimuth_rad), across * math.sin(azimuth_rad), math.cos(tilt_rad)])
    for critical_value in (0.0, 1e9):  # the arccosine always, the arctangent always
        found = fused_tilt(m, critical_value)
        assert math.sin(found.pitch_rad) == pytest.approx(m[0], abs=1e-7)
        assert math.sin(found.roll_rad) == pytest.approx(m[1], abs=1e-7)


@pytest.mark.parametrize(
    ("angle_deg", "by_arccosine"), [(30.0, False), (75.9, False), (76.3, True), (85.0, True), (-85.0, True)]
)
def test_the_arctangent_is_used_up_to_76_degrees_and_the_arccosine_beyond(angle_deg: float, by_arccosine: bool) -> None:
    """Łuczak n.d., eq. 27 to 30: of a reading of 1.01 g only the arctangent gives the angle itself."""
    long = 1.01 * math.cos(math.radians(angle_deg))
    expected = math.copysign(math.degrees(math.acos(long)), angle_deg) if by_arccosine else angle_deg
    assert math.degrees(fused_tilt(1.01 * pitched(angle_deg)).pitch_rad) == pytest.approx(expected, abs=1e-9)
    assert math.degrees(fused_tilt(1.01 * rolled(angle_deg)).roll_rad) == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
@given(
    st.floats(-1, 1), st.floats(-math.pi, math.pi), st.floats(-math.pi / 3, math.pi / 3), st.floats(-math.pi, math.pi)
)
def test_the_uncertainty_covers_noisy_readings_at_any_angle(
    z: float, azimuth_rad: float, noise_polar: float, noise_azimuth: float
) -> None:
    """001 claims 0.2 degrees over 360; an error of 1 mg in any direction is 0.06 degrees."""
    across = math.sqrt(1 - z * z)
    m = np.array([across * math.cos(azimuth_rad), across * math.sin(azimuth_rad), z])
    error = 0.001 * np.array(
        [
            math.cos(noise_polar) * math.cos(noise_azimuth),
            math.cos(noise_polar) * math.sin(noise_azimuth),
            math.sin(noise_polar),
        ]
    )
    exact, disturbed = fused_tilt(m), fused_tilt(m + error)
    for which in ("pitch_rad", "roll_rad"):
        difference_rad = getattr(disturbed, which) - getattr(exact, which)
        across_zero = (
            abs(m[2]) < 0.002 or abs(m[0 if which == "pitch_rad" else 1]) < 0.002
        )  # a sign that noise may turn
        if not across_zero:
            assert abs(math.degrees(difference_rad)) < 0.2


@pytest.mark.parametrize("angle_deg", [-170.0, -90.0, -10.0, 0.0, 33.0, 90.0, 179.0])
def test_pitch_and_axial_tilt_agree_with_the_rotation(angle_deg: float) -> None:
    assert math.degrees(fused_tilt(pitched(angle_deg)).pitch_rad) == pytest.approx(angle_deg, abs=1e-9)
    assert math.degrees(axial_tilt(pitched(angle_deg))) == pytest.approx(abs(angle_deg), abs=1e-9)


def test_a_reading_of_zero_has_no_uncertainty() -> None:
    assert math.isnan(axial_tilt_uncertainty(np.zeros(3), np.full(3, 0.001)))


@pytest.mark.slow
@given(st.floats(0, math.pi), st.floats(-math.pi, math.pi))
def test_plain_and_axial_tilt_agree_with_geometry(tilt_rad: float, azimuth_rad: float) -> None:
    force = np.array(
        [math.sin(tilt_rad) * math.cos(azimuth_rad), math.sin(tilt_rad) * math.sin(azimuth_rad), math.cos(tilt_rad)]
    )
    assert axial_tilt(force) == pytest.approx(tilt_rad, abs=1e-9)
    plain = plain_tilt(force)
    assert math.sin(plain.pitch_rad) == pytest.approx(force[0], abs=1e-9)
    assert math.sin(plain.roll_rad) == pytest.approx(force[1], abs=1e-9)


@pytest.mark.slow
@given(st.floats(-1.5, 1.5), st.floats(-math.pi + 1e-6, math.pi))
def test_the_roll_about_x_is_that_of_the_housing(pitch_rad: float, roll_rad: float) -> None:
    force = np.array(
        [math.sin(pitch_rad), math.cos(pitch_rad) * math.sin(roll_rad), math.cos(pitch_rad) * math.cos(roll_rad)]
    )
    assert roll_about_x(force) == pytest.approx(roll_rad, abs=1e-9)
    if abs(roll_rad) < 1.5:
        plain = plain_tilt(force)
        assert roll_from_angles(plain.roll_rad, plain.pitch_rad) == pytest.approx(roll_rad, abs=1e-6)


def test_a_vertical_x_axis_leaves_no_roll() -> None:
    assert math.isnan(roll_about_x(np.array([1.0, 0.0, 0.0])))
    assert math.isnan(roll_from_angles(0.0, math.pi / 2))
    assert math.isnan(roll_from_angles(0.0, -math.pi / 2))


def test_angles_that_no_attitude_has_give_a_roll_of_a_right_angle() -> None:
    """Noise makes the sine of beta exceed the cosine of alpha."""
    for sign in (1, -1):
        assert roll_from_angles(sign * math.radians(80.0), math.radians(11.0)) == pytest.approx(sign * math.pi / 2)


def test_the_lean_direction_points_to_the_load() -> None:
    """A load pulled toward +x leans the housing so that gravity's reaction gains a negative x component."""
    assert math.degrees(lean_direction(np.array([-0.1, 0.0, 0.99]))) == pytest.approx(0.0)
    assert math.degrees(lean_direction(np.array([0.0, -0.1, 0.99]))) == pytest.approx(90.0)


def test_uncertainty_is_that_of_repeated_readings() -> None:
    random = np.random.default_rng(2)
    u_force_g = np.array([0.002, 0.003, 0.004])
    for tilt_deg in (5.0, 30.0, 60.0):
        m = pitched(tilt_deg)
        readings = m + random.normal(size=(20_000, 3)) * u_force_g
        scatter_rad = float(np.std([axial_tilt(reading) for reading in readings]))
        assert axial_tilt_uncertainty(m, u_force_g) == pytest.approx(scatter_rad, rel=0.03)


def test_uncertainty_near_zero_tilt_counts_both_axes() -> None:
    assert axial_tilt_uncertainty(np.array([0.0, 0.0, 1.0]), np.array([0.003, 0.004, 0.1])) == pytest.approx(0.005)
