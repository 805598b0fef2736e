"""Zero in place and the aligning assistant."""

import numpy as np
import pytest

from gateway.calibration.alignment.screw_advice import ScrewMechanics, advise
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.zeroing import SUM_WARNING, zero, zeroing_rotation
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.record import CalibrationError, NotDeterminedError
from gateway.calibration.record_factory import make_record

STRAIGHT = np.eye(3)
HUNG = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # the sensor's x is up
UNITS_PER_G = 1000.0
U_OFFSET_G, U_ANGLE_RAD = 0.002, 0.005


def parent(gain=STRAIGHT, u_deg=0.5):
    covariance = np.diag([(np.radians(u_deg) / UNITS_PER_G) ** 2] * 9 + [(U_OFFSET_G * UNITS_PER_G) ** 2] * 3)
    fit = CalibrationFit(
        method="six-position",
        offset=(20.0, -10.0, 5.0),
        correction_matrix=np.linalg.inv(gain) / UNITS_PER_G,
        covariance=covariance,
        prediction_interval_g=0.05,
        poses=(),
        temperature_c=None,
        misalignment_deg={},
        residual_rms_g=0.0,
        condition_number=1.0,
        budget=(),
        warnings=(),
    )
    return make_record(
        fit, device_id="d", unit="counts", software="1", by="x", created_utc="2026-01-01T00:00:00Z", parent=None
    )


def hanging(force_g, seconds=40.0, noise_g=0.001, sway_g=0.0):
    random = np.random.default_rng(4)
    time_s = np.arange(round(seconds * 50)) / 50
    sway = sway_g * np.sin(2 * np.pi * 0.2 * time_s)
    raw = (np.asarray(force_g) + noise_g * random.standard_normal((len(time_s), 3))) * UNITS_PER_G + [20.0, -10.0, 5.0]
    raw[:, 1] += sway * UNITS_PER_G
    return RawReadings(time_s, raw, 22.0)


def direction(pitch_deg, roll_deg):
    x, y = np.sin(np.radians([pitch_deg, roll_deg]))
    return np.array([x, y, np.sqrt(1 - x * x - y * y)])


@pytest.mark.parametrize("turn", [STRAIGHT, HUNG])
def test_the_mean_points_along_the_rope_afterwards(turn):
    force = turn.T @ direction(2.0, -3.0)
    fit = zero(hanging(force), parent(), turn, UNITS_PER_G)
    housing = turn @ fit.correction_matrix @ (force * UNITS_PER_G)
    np.testing.assert_allclose(housing, [0, 0, 1], atol=3e-4)
    assert fit.method == "zero"
    assert fit.offset == (20.0, -10.0, 5.0)
    assert SUM_WARNING in fit.warnings
    assert "removed pitch +2.0" in fit.warnings[1]
    assert "roll -3.0" in fit.warnings[1]


def test_the_turn_about_the_rope_is_left_alone():
    rotation = zeroing_rotation(direction(4.0, -6.0))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation @ direction(4.0, -6.0), [0, 0, 1], atol=1e-12)
    assert rotation[0, 1] == rotation[1, 0]  # no part about z


def test_what_is_known_at_the_rope_is_the_plumb_line_not_the_record():
    """Hanging, the new record's angles are as good as the rope; upright again on a side, the parent's offset shows."""
    fit = zero(hanging(direction(1.0, 1.0)), parent(), STRAIGHT, UNITS_PER_G, plumb_u_deg=0.05)
    raw = np.linalg.solve(fit.correction_matrix, [0, 0, 1.0])
    jacobian = np.hstack([np.kron(np.eye(3), raw), -fit.correction_matrix])
    u_hanging = np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))
    np.testing.assert_allclose(u_hanging[:2], np.radians(0.05), rtol=0.1)
    sideways = np.linalg.solve(fit.correction_matrix, [1.0, 0, 0])
    jacobian = np.hstack([np.kron(np.eye(3), sideways), -fit.correction_matrix])
    assert np.sqrt(np.diag(jacobian @ fit.covariance @ jacobian.T))[2] > 0.005


def test_zero_refuses_a_short_rest():
    with pytest.raises(NotDeterminedError, match="let the load hang still for 30 s"):
        zero(hanging(direction(1, 1), seconds=20.0), parent(), STRAIGHT, UNITS_PER_G)


def test_zero_refuses_a_swinging_load():
    with pytest.raises(NotDeterminedError, match="still swings"):
        zero(hanging(direction(1, 1), sway_g=0.01), parent(), STRAIGHT, UNITS_PER_G)


def test_zero_refuses_an_implausible_mount():
    with pytest.raises(CalibrationError, match=r"12\.0 deg off the vertical, more than 10"):
        zero(hanging(direction(12, 0)), parent(), STRAIGHT, UNITS_PER_G)


def test_zero_refuses_a_record_that_no_longer_fits():
    with pytest.raises(CalibrationError, match=r"\|m\| at rest is 1\.1"):
        zero(hanging(1.1 * direction(1, 1)), parent(), STRAIGHT, UNITS_PER_G)


def test_the_larger_angle_is_turned_first():
    advice = advise(np.radians(0.2), np.radians(-0.9), u_rad=1e-5, still=True)
    assert (advice.state, advice.screw, advice.direction) == ("turn", "roll", "in")
    assert advice.turns == pytest.approx(np.tan(np.radians(0.9)) * 40 / 0.5)
    assert "turn the roll screw in by 1.26" in advice.text


def test_following_the_advice_converges():
    """The screws act on each other by a tenth, and each turn is done to a fifth only."""
    angles = {"pitch": np.radians(3.0), "roll": np.radians(-2.0)}
    screws = ScrewMechanics(roll_sign=-1)
    for _ in range(20):
        advice = advise(angles["pitch"], angles["roll"], u_rad=1e-5, still=True, screws=screws)
        if advice.state == "aligned":
            break
        other = "roll" if advice.screw == "pitch" else "pitch"
        sign = {"pitch": screws.pitch_sign, "roll": screws.roll_sign}[advice.screw] * (
            1 if advice.direction == "in" else -1
        )
        change = sign * 1.2 * advice.turns * screws.lead_m / screws.lever_m
        angles[advice.screw] += change
        angles[other] += 0.1 * change
    assert advice.state == "aligned"
    assert max(abs(angle) for angle in angles.values()) <= np.radians(0.03)


def test_nothing_is_advised_while_it_moves_or_is_not_known():
    assert advise(0.1, 0.0, u_rad=1e-5, still=False).state == "not_still"
    assert advise(float("nan"), 0.0, u_rad=1e-5, still=True).state == "not_still"
    assert advise(0.0, 0.0, u_rad=np.radians(0.02), still=True).state == "too_noisy"


def test_impossible_screws_are_refused():
    with pytest.raises(ValueError, match="sign is 1 or -1"):
        ScrewMechanics(pitch_sign=0)
