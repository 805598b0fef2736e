"""Single-parameter calibration: the source's table and figure, planted parameters, limits."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.bench.single_parameter import (
    DisplacementPairs,
    LaserSetup,
    approximation_error,
    correct_relative_angle,
    fit_single_parameter,
    pair_parameters_g,
    pair_uncertainties_g,
    relative_angle_u_rad,
)
from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array
from tests.benchmarks.inclinometer import compare, largest_errors_deg

TABLE_7_MM = np.array([107.78, 160.09, 216.80, 279.01])
TABLE_7_DEG = np.array([1.605, 2.384, 3.224, 4.146])
TABLE_7_M = 3.897
"""Zhu et al. 2020, table 7."""
STATED = LaserSetup(TABLE_7_M, 0.0015, 0.0, 0.0, 0.0)


def pairs_of(displacement_m: Array, raw_deg: Array, u_m: float = 0.00005) -> DisplacementPairs:
    n = len(displacement_m)
    return DisplacementPairs(displacement_m, np.full(n, u_m), np.radians(raw_deg), np.zeros(n, dtype=np.int64))


TABLE_7 = pairs_of(TABLE_7_MM / 1000, TABLE_7_DEG)


def test_equation_13_gives_the_parameters_of_table_7() -> None:
    """Recomputed from the printed displacements and angles; the printed -12.7 and -13.1 mg are within the angles' rounding."""
    found_mg = 1000 * pair_parameters_g(TABLE_7, TABLE_7_M)
    np.testing.assert_allclose(found_mg, [-13.0, -13.3, -12.4, -12.3], atol=0.05)
    rounding_mg = 1000 * np.radians(0.0005) / TABLE_7.raw_angle_rad
    assert np.all(np.abs(found_mg - [-12.7, -13.1, -12.3, -12.3]) < rounding_mg + 0.05)


def test_equation_21_gives_the_uncertainties_that_follow_from_the_stated_ones() -> None:
    """The printed 0.6, 0.4, 0.3, 0.2 mg do not: the distance alone contributes 0.385 mg to each."""
    np.testing.assert_allclose(1000 * pair_uncertainties_g(TABLE_7, STATED), [0.60, 0.50, 0.45, 0.42], atol=0.005)
    only_distance = pairs_of(TABLE_7_MM / 1000, TABLE_7_DEG, u_m=0.0)
    np.testing.assert_allclose(1000 * pair_uncertainties_g(only_distance, STATED), 0.385, atol=0.002)


def test_the_mean_of_many_pairs_is_no_better_than_the_distance() -> None:
    many = pairs_of(np.tile(TABLE_7_MM, 50) / 1000, np.tile(TABLE_7_DEG, 50))
    assert fit_single_parameter(TABLE_7, STATED).u_g > fit_single_parameter(many, STATED).u_g > 0.000385


@pytest.mark.parametrize("sides_deg", [[1.0, 2.0, 3.0, 4.0], [2.0, 4.0], [1.0, 2.0, 3.0], [0.5, 1.0, 1.5, 2.0]])
def test_causes_that_cancel_between_pairs_on_both_sides_of_the_zero_contribute_nothing(sides_deg: list[float]) -> None:
    angle_deg = np.concatenate((sides_deg, np.negative(sides_deg)))
    fit = fit_single_parameter(pairs_of(3.897 * np.tan(np.radians(angle_deg)), 1.0129 * angle_deg), LaserSetup(3.897))
    assert fit.a_z_off_g == pytest.approx(-np.log(1.0129))
    contributions = {each.source: each.u_g for each in fit.contributions}
    for source in ("squareness of the beam at zero", "zero-g offset of the reading axis"):
        assert contributions[source] == pytest.approx(0.0, abs=1e-12)
    assert np.hypot.reduce(list(contributions.values())) == pytest.approx(fit.u_g)


def test_equation_20_gives_the_relative_uncertainty_of_a_calibrated_angle() -> None:
    fit = fit_single_parameter(TABLE_7, STATED)
    u = relative_angle_u_rad(np.radians([2.0]), fit, np.radians(0.001)) / correct_relative_angle(
        np.radians([2.0]), fit.a_z_off_g
    )
    assert u[0] == pytest.approx(np.sqrt(fit.u_g**2 + 0.0005**2 + (approximation_error(fit.a_z_off_g) ** 2) / 3))


def test_the_offset_of_the_reading_axis_acts_by_half_of_it_per_radian() -> None:
    """Large enough to show beside the other causes, at two angles: linear in the offset, square in the angle."""
    fit = fit_single_parameter(TABLE_7, STATED)
    tilted = replace(fit, a_z_off_g=0.0, u_g=0.0, setup=replace(fit.setup, u_zero_g_offset_g=0.1))
    raw = np.radians([1.0, 3.0])
    np.testing.assert_allclose(relative_angle_u_rad(raw, tilted, 0.0), 0.05 * raw**2, rtol=1e-6)
    np.testing.assert_allclose(relative_angle_u_rad(raw, tilted, 0.01), np.hypot(0.01, 0.05 * raw**2), rtol=1e-6)


def test_the_approximation_error_is_that_of_figure_7() -> None:
    assert 100 * approximation_error(0.030) == pytest.approx(0.05, abs=0.005)
    assert approximation_error(0.0) < 1e-12


def test_a_sensor_with_an_offset_of_z_alone_is_corrected_exactly_to_the_approximation_of_its_range() -> None:
    offset_g = 0.03
    actual = np.radians([1.0, 2.0, 3.0, 4.0, 5.0])
    raw = np.arctan2(np.sin(actual), np.cos(actual) + offset_g)
    fit = fit_single_parameter(pairs_of(TABLE_7_M * np.tan(actual[:4]), np.degrees(raw[:4])), STATED)
    assert np.expm1(fit.a_z_off_g) == pytest.approx(offset_g, abs=3e-5)  # 0.002 % remain over the range
    np.testing.assert_allclose(correct_relative_angle(raw * 0.999, fit.a_z_off_g), actual * 0.999, rtol=5e-5)


@pytest.mark.slow
def test_planted_parameters_are_recovered_within_their_95_percent_intervals() -> None:
    """Distance, squareness, zero-g offset, spot and angle are drawn as stated; the exact angles of the sensor are read."""
    setup, hits = LaserSetup(TABLE_7_M), []
    actual = np.radians([1.2, 2.1, 3.0, 3.9, 4.8])
    for seed in range(600):
        random = np.random.default_rng(seed)
        offset_x, offset_z = setup.u_zero_g_offset_g * random.standard_normal(), random.uniform(-0.03, 0.03)
        raw = np.arctan2(np.sin(np.append(0, actual)) + offset_x, np.cos(np.append(0, actual)) + offset_z)
        raw += setup.u_raw_angle_rad / np.sqrt(2) * random.standard_normal(6)
        start = setup.u_square_rad * random.standard_normal()
        distance = TABLE_7_M + setup.u_distance_m * random.standard_normal()
        spot = distance * (np.tan(start + np.append(0, actual)) - np.tan(start))
        spot += 0.00005 / np.sqrt(2) * random.standard_normal(6)
        fit = fit_single_parameter(pairs_of(spot[1:] - spot[0], np.degrees(raw[1:] - raw[0])), setup)
        hits.append(abs(fit.a_z_off_g - np.log1p(offset_z)) <= 1.96 * fit.u_g)
    assert 0.92 < np.mean(hits) < 0.975


def test_pairs_that_contradict_each_other_enlarge_the_uncertainty() -> None:
    wrong = pairs_of(TABLE_7_MM / 1000 * np.array([1, 1, 1, 1.01]), TABLE_7_DEG)
    setup = LaserSetup(TABLE_7_M)
    assert fit_single_parameter(wrong, setup).widened > 3
    assert fit_single_parameter(TABLE_7, setup).widened == 1


@pytest.mark.parametrize("angle_deg", [5.1, -5.1])
def test_an_angle_beyond_five_degrees_is_refused(angle_deg: float) -> None:
    with pytest.raises(InputError, match="beyond"):
        correct_relative_angle(np.radians([1.0, angle_deg]), 0.0)


@pytest.mark.parametrize(
    ("d_mm", "raw_deg", "said"), [(100, -1.5, "of one sign"), (0, 1.0, "zero"), (400, 5.9, "beyond")]
)
def test_a_pair_that_the_method_cannot_use_is_refused(d_mm: float, raw_deg: float, said: str) -> None:
    pairs = pairs_of(np.array([0.1, d_mm / 1000]), np.array([1.49, raw_deg]))
    with pytest.raises(NotDeterminedError, match=f"pair 2.*{said}"):
        fit_single_parameter(pairs, STATED)


def test_the_comparison_of_figures_11_and_12_is_reproduced_in_simulation() -> None:
    """Printed: 0.060, 0.019 and 0.004 deg; 1.22, -0.31 and -0.04 %."""
    errors = {name: float(np.median(values)) for name, values in largest_errors_deg(60).items()}
    assert errors["raw"] == pytest.approx(0.060, abs=0.003)
    assert errors["six_parameter"] == pytest.approx(0.019, abs=0.004)
    assert errors["single_parameter"] == pytest.approx(0.004, abs=0.002)
    one = compare(1)
    assert one.a_z_off_mg == pytest.approx(-12.2, abs=3 * one.u_mg)
