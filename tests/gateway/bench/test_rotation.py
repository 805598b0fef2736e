"""Rotation calibration: planted sensors are recovered, and turns that do not determine them are refused."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.bench.rotation import fit_rotation
from gateway.bench.rotation_turn import TurnReadings, fit_turn
from gateway.calibration.record import NotDeterminedError
from tests.benchmarks.rotation import coverage
from tests.benchmarks.rotation_turns import Rig, draw_sensor, turn
from tests.values import present

PERFECT = Rig(mounting_deg=0, level_deg=0, angle_deg=0, noise_g=0)


def random(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def perfect_turn(rotation_axis: int = 1) -> TurnReadings:
    return turn(random(), draw_sensor(random(2)), rotation_axis, PERFECT)


def test_two_perfect_turns_determine_the_sensor_exactly() -> None:
    sensitivity, offset = draw_sensor(random(2))
    fit = present(fit_rotation((perfect_turn(1), perfect_turn(0))).calibration)
    np.testing.assert_allclose(fit.correction_matrix, np.linalg.inv(sensitivity), atol=1e-12)
    np.testing.assert_allclose(fit.offset, offset, atol=1e-12)


def test_one_turn_gives_offset_scale_and_phase_of_equations_11_and_12() -> None:
    angle = np.radians(np.arange(0, 360, 10.0))
    c_x, c_z = np.radians(0.3), np.radians(-0.5)
    volts = np.column_stack([1.48 + 0.41 * np.sin(angle + c_x), 1.5 + 0 * angle, 1.51 + 0.42 * np.cos(angle + c_z)])
    fit = fit_rotation((TurnReadings("t", angle, volts, np.ones(36), None, None),))
    x, z = fit.turns[0].axis_sines()
    np.testing.assert_allclose([x.offset, x.scale, x.phase_rad], [1.48, 0.41, c_x], atol=1e-12)
    np.testing.assert_allclose([z.offset, z.scale, z.phase_rad], [1.51, 0.42, c_z], atol=1e-12)
    (pair,) = fit.pairs
    assert pair.axes == (0, 2)
    assert np.degrees(pair.angle_rad) == pytest.approx(-0.8, abs=1e-9)
    assert fit.calibration is None


def test_non_orthogonality_is_the_angle_between_the_axes() -> None:
    sensitivity, _ = draw_sensor(random(2))
    fit = fit_rotation((perfect_turn(1), perfect_turn(0)))
    for pair in fit.pairs:
        one, other = (sensitivity[axis] for axis in pair.axes)
        between = np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other))
        assert pair.angle_rad == pytest.approx(between - np.pi / 2, abs=2e-3)  # out-of-plane parts are of second order


def test_the_permissible_error_of_the_norm_does_not_depend_on_the_zero_of_the_output() -> None:
    """Eq. 14 as printed subtracts the offset from an interval's width: 1.5 V of offset would give minus 3.6 g."""
    noisy = turn(random(), draw_sensor(random(2)), 1, Rig())
    shifted = replace(noisy, mean=0.42 * noisy.mean + 1.5)
    dm = fit_rotation((noisy,)).norm_error_g
    assert fit_rotation((shifted,)).norm_error_g == pytest.approx(dm)
    assert 0.0003 < dm < 0.002


def test_a_non_orthogonality_and_its_uncertainty_do_not_depend_on_the_unit() -> None:
    noisy = turn(random(), draw_sensor(random(2)), 1, Rig())
    in_volts = replace(noisy, mean=0.42 * noisy.mean + 1.5)
    (one,), (other,) = fit_rotation((noisy,)).pairs, fit_rotation((in_volts,)).pairs
    assert (other.angle_rad, other.u_rad) == pytest.approx((one.angle_rad, one.u_rad))


@pytest.mark.slow
def test_the_prediction_interval_holds_95_percent_of_further_readings() -> None:
    rig = Rig(angle_deg=0, noise_g=1e-3)
    hits = []
    for seed in range(200):
        sensor = draw_sensor(random(seed))
        fixed = replace(rig, mounting_deg=0, level_deg=0)
        fit = fit_turn(turn(random(seed), sensor, 1, fixed))
        more = turn(random(1000 + seed), sensor, 1, fixed)
        for sine in fit.axis_sines():
            fitted = fit.readings.mean[:, sine.axis] - fit.residual[:, sine.axis]
            hits.append(np.abs(more.mean[:, sine.axis] - fitted) <= sine.prediction)
    assert 0.94 < np.mean(hits) < 0.965


@pytest.mark.slow
@pytest.mark.parametrize(
    "rig", [Rig(), Rig(angle_deg=0, noise_g=5e-4), Rig(angles=12)], ids=["rig", "noise", "12 angles"]
)
def test_planted_sensors_are_recovered_within_their_95_percent_intervals(rig: Rig) -> None:
    share = coverage(rig, 150)
    assert 0.935 < share.mean() < 0.97
    assert share.min() > 0.88


def test_a_rotation_axis_off_the_horizontal_is_found_and_corrected() -> None:
    sensitivity, offset = sensor = draw_sensor(random(2))
    tilted = turn(random(4), sensor, 1, replace(PERFECT, level_deg=1))
    level = np.radians(1) * random(4).standard_normal(37)[36]  # drawn after the errors of the 36 angles
    fit = fit_rotation((tilted, perfect_turn(0)))
    assert fit.level_rad[0] == pytest.approx(level, rel=0.05)
    np.testing.assert_allclose(present(fit.calibration).offset, offset, atol=2e-5)
    np.testing.assert_allclose(present(fit.calibration).correction_matrix, np.linalg.inv(sensitivity), atol=5e-5)


def test_an_axis_that_changed_between_the_turns_is_reported() -> None:
    rng, sensor = random(), draw_sensor(random(2))
    moved = turn(rng, (sensor[0], sensor[1] + [0, 0, 0.01]), 0, Rig())
    warnings = present(fit_rotation((turn(rng, sensor, 1, Rig()), moved)).calibration).warnings
    assert any(warning.text.startswith("offset z differs by") for warning in warnings)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda angle: (angle, angle < np.pi), "no reading between 170 and 0 deg"),
        (lambda angle: (-angle, angle < 9), "shift or negate the angles"),
        (lambda angle: (angle + 0.5, angle < 9), "shift or negate the angles"),
        (lambda angle: (angle, np.arange(36) % 4 == 0), "9 different angles"),
    ],
    ids=["half a turn", "wrong direction", "wrong zero", "few angles"],
)
def test_a_turn_that_is_not_as_the_method_needs_it_is_refused(change: object, said: str) -> None:
    assert callable(change)
    whole = perfect_turn()
    angle, kept = change(whole.angle_rad)
    readings = replace(whole, angle_rad=angle[kept], mean=whole.mean[kept], count=whole.count[kept])
    with pytest.raises(NotDeterminedError, match=said):
        fit_rotation((readings,))


def test_two_turns_about_one_axis_are_refused() -> None:
    with pytest.raises(NotDeterminedError, match="turns about y and y"):
        fit_rotation((perfect_turn(1), perfect_turn(1)))


def test_a_rotation_axis_far_from_the_horizontal_is_refused() -> None:
    steep = turn(random(4), draw_sensor(random(2)), 1, replace(PERFECT, level_deg=20))
    with pytest.raises(NotDeterminedError, match="level the rig"):
        fit_rotation((steep, perfect_turn(0)))
