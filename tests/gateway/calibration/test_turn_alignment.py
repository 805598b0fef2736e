"""Alignment on a shaft: planted tilts are read, the right screw is named, and the equations of the source hold."""

import math

import numpy as np
import pytest

from gateway.calibration.alignment.turn_advice import (
    OWN_SCREWS,
    AligningUnit,
    Turn,
    advise_after_turn,
    alignment_precision_error_rad,
    calibration_error_rad,
    fit_turn,
    shaft_axis,
    total_alignment_error_rad,
)
from gateway.calibration.alignment.turn_assistant import TurnMonitor, TurnReadout, sensor_force_g
from gateway.numerics.array import Array
from tests.values import present


def turning(
    axis: int,
    towards_deg: tuple[float, float, float],
    *,
    turns: float = 1.02,
    noise_g: float = 1e-4,
    per_turn: int = 300,
    seed: int = 1,
    offset_g: tuple[float, float, float] = (0.02, -0.03, 0.04),
) -> Array:
    """Return readings of a sensor that turns about a horizontal shaft along an axis, whose own axis is tilted, g, (n, 3)."""
    random = np.random.default_rng(seed)
    angle = np.linspace(0.3, 0.3 + 2 * np.pi * turns, round(per_turn * turns))
    first, second = (other for other in range(3) if other != axis)
    force = np.zeros((len(angle), 3))
    force[:, first], force[:, second] = np.cos(angle), np.sin(angle)
    directions = np.eye(3)
    directions[axis] += np.radians(towards_deg)
    return np.asarray(force @ directions.T + np.array(offset_g) + noise_g * random.standard_normal(force.shape))


def test_equations_1_to_3_give_the_printed_angles() -> None:
    precision_rad = alignment_precision_error_rad(0.00015 / 0.41)
    assert math.degrees(precision_rad) == pytest.approx(0.021, abs=5e-4)
    assert math.degrees(total_alignment_error_rad(precision_rad, math.radians(0.01))) == pytest.approx(0.03, abs=0.0015)
    assert math.degrees(calibration_error_rad(math.radians(1.0))) == pytest.approx(0.0087, abs=5e-5)


def test_equations_1_and_3_hold_where_the_arcsine_is_not_its_argument() -> None:
    assert math.degrees(alignment_precision_error_rad(0.5)) == pytest.approx(30.0)
    assert math.degrees(alignment_precision_error_rad(1.05)) == pytest.approx(90.0)
    assert math.degrees(calibration_error_rad(math.radians(60.0))) == pytest.approx(30.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_planted_tilt_is_recovered_within_its_interval(axis: int) -> None:
    towards = [0.4, -0.9, 0.7]
    towards[axis] = 0.0
    hits = []
    for seed in range(40):
        turn = present(fit_turn(turning(axis, (towards[0], towards[1], towards[2]), seed=seed), axis))
        hits += [
            abs(found - math.radians(planted)) < 2.1 * turn.u_rad  # Student's t with 21 degrees of freedom
            for place, (found, planted) in enumerate(zip(turn.towards, towards, strict=True))
            if place != axis
        ]
    assert 0.85 <= np.mean(hits) <= 1.0
    assert turn.u_rad < math.radians(0.002)
    assert turn.peak_to_peak_g == pytest.approx(2 * turn.misalignment_rad, rel=0.02)
    assert turn.floor_g < 2e-4


def test_the_peak_to_peak_of_an_aligned_axis_is_its_floor() -> None:
    ratios = []
    for seed in range(30):
        turn = present(fit_turn(turning(0, (0, 0, 0), noise_g=1e-3, seed=seed), 0))
        ratios.append(turn.peak_to_peak_g / turn.floor_g)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    assert present(fit_turn(turning(0, (0, 0, 0), noise_g=1e-6), 0, step_g=4e-4)).floor_g == pytest.approx(8e-4)


def test_the_axis_along_the_shaft_is_found() -> None:
    for axis in range(3):
        assert shaft_axis(turning(axis, (0.5 * (axis != 0), 0.5 * (axis != 1), 0.5 * (axis != 2)))) == axis
    assert shaft_axis(turning(0, (0, 0, 0), turns=0.9)) is None
    lying = np.tile([0.0, 0.0, 1.0], (400, 1)) + 1e-3 * np.random.default_rng(0).standard_normal((400, 3))
    assert shaft_axis(lying) is None


def rotate(axis: str, angle_rad: float, vector: Array) -> Array:
    return np.asarray(vector + np.cross(angle_rad * np.eye(3)["xyz".index(axis)], vector))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_turning_the_advised_screws_aligns_the_axis(axis: int) -> None:
    """The unit turns as the advice says: after two adjustments the axis is parallel to the shaft."""
    unit = AligningUnit(screws=OWN_SCREWS, reversed_axes=frozenset({"z"}))
    direction = np.eye(3)[axis] + np.radians([0.8, -1.1, 0.6]) * (np.arange(3) != axis)
    states = []
    for attempt in range(4):
        towards_deg = np.degrees(direction) * (np.arange(3) != axis)
        x, y, z = towards_deg.tolist()
        advice = advise_after_turn(present(fit_turn(turning(axis, (x, y, z), seed=attempt), axis)), unit=unit)
        states.append(advice.state)
        if advice.screw_axis is not None:
            angle_rad = math.atan(advice.turns * unit.lead_m / unit.lever_m)
            sign = (1 if advice.direction == "in" else -1) * (-1 if advice.screw_axis == "z" else 1)
            direction = rotate(advice.screw_axis, sign * angle_rad, direction)
    assert states == ["adjust", "adjust", "aligned", "aligned"]
    assert math.degrees(advice.total_error_rad) < 0.03


def test_the_shared_unit_uses_the_screws_of_the_source() -> None:
    x_turn = present(fit_turn(turning(0, (0, 0.2, 0.9)), 0))
    assert advise_after_turn(x_turn).text.startswith("turn screw 5 (about y) in by")
    y_turn = present(fit_turn(turning(1, (0.9, 0, 0.2)), 1))
    assert advise_after_turn(y_turn).text.startswith("turn screw 4 (about x) out by")
    y_aligned = present(fit_turn(turning(1, (0.9, 0, 0.0)), 1))
    advice = advise_after_turn(y_aligned)
    assert advice.state == "converged"
    assert "deg remain that no screw of y corrects" in advice.text
    assert math.degrees(advice.total_error_rad) == pytest.approx(0.91, abs=0.01)
    assert "no screw of its own" in advise_after_turn(present(fit_turn(turning(2, (0.2, 0.1, 0)), 2))).text


def test_an_adjustment_the_wrong_way_and_noise_are_reported() -> None:
    before, after = (present(fit_turn(turning(0, (0, 0, angle)), 0)) for angle in (0.5, 0.8))
    assert "it is --reversed y" in advise_after_turn(after, before).text
    noisy = Turn(0, 0.004, 0.004, (0.0, 4e-4, 4e-4), 5e-4)
    assert advise_after_turn(noisy).state == "at_floor"


def follow(monitor: TurnMonitor, force_g: Array) -> TurnReadout:
    for number, reading in enumerate(force_g):
        view = monitor.add(number / 10, reading)
    return view


@pytest.mark.slow
def test_the_monitor_reads_each_complete_turn() -> None:
    monitor = TurnMonitor()
    view = follow(monitor, turning(0, (0, 0.5, 0), turns=0.7))
    assert (view.turn, view.n_turns) == (None, 0)
    view = follow(TurnMonitor(), turning(0, (0, 0.5, 0), turns=3.5))
    assert view.n_turns == 3  # after 360, 780 and 1200 degrees
    assert present(view.turn).axis == 0
    assert present(view.advice).screw_axis == "z"
    assert math.degrees(present(view.turn).towards[1]) == pytest.approx(0.5, abs=0.01)


def test_a_correction_that_hides_the_misalignment_is_undone() -> None:
    force = turning(0, (0, 0, 0), noise_g=0.0, offset_g=(0.0, 0.0, 0.0))
    sensitivity = 1000 * np.array([[1.0, np.radians(0.7), 0], [0, 1.02, 0], [0, 0, 0.99]])
    own = sensor_force_g(force, np.linalg.inv(sensitivity))
    assert math.degrees(present(fit_turn(own, 0)).towards[1]) == pytest.approx(0.7, rel=1e-3)
