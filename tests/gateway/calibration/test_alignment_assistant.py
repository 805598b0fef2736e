"""The assistant of an alignment: what the angles of the hanging housing tell to do, and which screw to turn how far."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.calibration.alignment.assistant import (
    MIN_WINDOW_TILTS,
    AlignmentAssistant,
    AlignmentReadout,
    Screw,
    ScrewMechanics,
    advise,
)
from gateway.messages import Tilt

TILT = Tilt(
    time_ns=0,
    clock="synchronised",
    sequence=0,
    calibration_id="r1",
    pitch_deg=0.2,
    roll_deg=-1.5,
    axial_deg=1.51,
    u_deg=0.05,
    direction_deg=0.0,
    specific_force_g=[0.0, 0.0, 1.0],
    temperature_c=None,
    delay_s=0.2,
    trusted=True,
)


def add_tilts(
    assistant: AlignmentAssistant,
    pitch_deg: float,
    roll_deg: float,
    noise_deg: float = 0.0,
    tilts: int = MIN_WINDOW_TILTS,
    **changes: Any,
) -> AlignmentReadout:
    """Add tilts at ten per second, and return the last view."""
    random = np.random.default_rng(1)
    for number in range(tilts):
        pitch, roll = (pitch_deg, roll_deg) + noise_deg * random.standard_normal(2)
        view = assistant.add_tilt(
            replace(TILT, time_ns=number * 100_000_000, pitch_deg=float(pitch), roll_deg=float(roll), **changes)
        )
    return view


def test_it_waits_for_an_average_and_then_names_screw_direction_and_turns() -> None:
    assistant = AlignmentAssistant()
    assert add_tilts(assistant, 0.2, -1.5, tilts=MIN_WINDOW_TILTS - 1).advice.state == "not_still"
    view = add_tilts(assistant, 0.2, -1.5, noise_deg=0.01, tilts=2)
    assert (view.advice.state, view.advice.screw, view.advice.direction) == ("turn", "roll", "in")
    assert view.advice.turns == pytest.approx(np.tan(np.radians(1.5)) * 80, rel=0.02)
    assert view.u_calibration_deg == TILT.u_deg


def test_a_screw_of_the_other_sign_is_turned_the_other_way() -> None:
    view = add_tilts(AlignmentAssistant(ScrewMechanics(roll_sign=-1)), 0.2, -1.5)
    assert view.advice.direction == "out"


def test_only_settled_angles_are_aligned() -> None:
    assert add_tilts(AlignmentAssistant(), 0.01, -0.02).advice.state == "aligned"
    assert add_tilts(AlignmentAssistant(), 0.01, -0.02, noise_deg=0.05, tilts=20).advice.state in ("too_noisy", "turn")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"trusted": False}, "while the load moves"),
        ({"calibration_id": None}, "recalibrate first"),
        ({"trusted": False, "calibration_id": None}, "recalibrate first"),
    ],
)
def test_there_is_no_advice_without_rest_or_record(changes: dict[str, Any], text: str) -> None:
    view = add_tilts(AlignmentAssistant(), 0.2, -1.5, **changes)
    assert (view.advice.state, view.advice.screw) == ("not_still", None)
    assert text in view.advice.text


def test_a_housing_that_does_not_hang_gets_no_advice() -> None:
    view = add_tilts(AlignmentAssistant(), 0.2, 89.0)
    assert view.advice.screw is None
    assert "does not hang" in view.advice.text


def test_unknown_angles_are_none() -> None:
    view = AlignmentAssistant().add_tilt(replace(TILT, pitch_deg=None))
    assert (view.pitch_deg, view.advice.state) == (None, "not_still")


def test_angles_before_a_movement_are_discarded() -> None:
    assistant = AlignmentAssistant()
    add_tilts(assistant, 0.2, -1.5)
    assistant.add_tilt(replace(TILT, trusted=False))
    assert assistant.add_tilt(TILT).advice.state == "not_still"


def test_the_larger_angle_comes_first() -> None:
    advice = advise(np.radians(0.2), np.radians(-0.9), u_rad=1e-5)
    assert (advice.state, advice.screw, advice.direction) == ("turn", "roll", "in")
    assert advice.turns == pytest.approx(np.tan(np.radians(0.9)) * 40 / 0.5)
    assert "turn the roll screw in by 1.26" in advice.text


def test_following_the_advice_aligns_the_housing() -> None:
    """Each screw also changes the other angle by a tenth, and each turn is a fifth too large."""
    angles: dict[Screw, float] = {"pitch": np.radians(3.0), "roll": np.radians(-2.0)}
    screws = ScrewMechanics(roll_sign=-1)
    for _ in range(20):
        advice = advise(angles["pitch"], angles["roll"], u_rad=1e-5, screws=screws)
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


def test_no_turn_is_advised_while_the_angle_is_unknown_or_noisy() -> None:
    assert advise(float("nan"), 0.0, u_rad=1e-5).state == "not_still"
    assert advise(0.0, 0.0, u_rad=np.radians(0.02)).state == "too_noisy"


def test_impossible_screws_are_refused() -> None:
    with pytest.raises(ValueError, match="sign is 1 or -1"):
        ScrewMechanics(pitch_sign=0)
