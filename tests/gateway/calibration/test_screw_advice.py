"""Advice on the screws of the housing: order, convergence, and no advice without knowledge."""

import numpy as np
import pytest

from gateway.calibration.alignment.assistant import Screw, ScrewMechanics, advise


def test_the_larger_angle_comes_first() -> None:
    advice = advise(np.radians(0.2), np.radians(-0.9), u_rad=1e-5, still=True)
    assert (advice.state, advice.screw, advice.direction) == ("turn", "roll", "in")
    assert advice.turns == pytest.approx(np.tan(np.radians(0.9)) * 40 / 0.5)
    assert "turn the roll screw in by 1.26" in advice.text


def test_following_the_advice_aligns_the_housing() -> None:
    """Each screw also changes the other angle by a tenth, and each turn is a fifth too large."""
    angles: dict[Screw, float] = {"pitch": np.radians(3.0), "roll": np.radians(-2.0)}
    screws = ScrewMechanics(roll_sign=-1)
    for _ in range(20):
        advice = advise(angles["pitch"], angles["roll"], u_rad=1e-5, still=True, screws=screws)
        if advice.state == "aligned":
            break
        assert advice.screw is not None
        other: Screw = "roll" if advice.screw == "pitch" else "pitch"
        sign = screws.pitch_sign if advice.screw == "pitch" else screws.roll_sign
        direction = 1 if advice.direction == "in" else -1
        change = sign * direction * 1.2 * advice.turns * screws.lead_m / screws.lever_m
        angles[advice.screw] += change
        angles[other] += 0.1 * change
    assert advice.state == "aligned"
    assert max(abs(angle) for angle in angles.values()) <= np.radians(0.03)


def test_no_turn_is_advised_while_the_housing_moves_or_the_angle_is_unknown() -> None:
    assert advise(0.1, 0.0, u_rad=1e-5, still=False).state == "not_still"
    assert advise(float("nan"), 0.0, u_rad=1e-5, still=True).state == "not_still"
    assert advise(0.0, 0.0, u_rad=np.radians(0.02), still=True).state == "too_noisy"


def test_impossible_screws_are_refused() -> None:
    with pytest.raises(ValueError, match="sign is 1 or -1"):
        ScrewMechanics(pitch_sign=0)
