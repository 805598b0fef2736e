"""Advice on live tilts: only of a calibrated sensor that hangs still, averaged, and settled before it says aligned."""

from dataclasses import replace

import numpy as np
import pytest

from gateway.calibration.alignment.assistant import FEWEST, Aligning
from gateway.calibration.alignment.screw_advice import ScrewMechanics
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


def advised(aligning, pitch_deg, roll_deg, noise_deg=0.0, tilts=FEWEST, **changes):
    random = np.random.default_rng(1)
    for number in range(tilts):
        pitch, roll = (pitch_deg, roll_deg) + noise_deg * random.standard_normal(2)
        view = aligning.add_samples(
            replace(TILT, time_ns=number * 100_000_000, pitch_deg=float(pitch), roll_deg=float(roll), **changes)
        )
    return view


def test_it_waits_for_an_average_and_then_names_screw_way_and_turns():
    aligning = Aligning()
    assert advised(aligning, 0.2, -1.5, tilts=FEWEST - 1).advice.state == "not_still"
    view = advised(aligning, 0.2, -1.5, noise_deg=0.01, tilts=2)
    assert (view.advice.state, view.advice.screw, view.advice.direction) == ("turn", "roll", "in")
    assert view.advice.turns == pytest.approx(np.tan(np.radians(1.5)) * 80, rel=0.02)
    assert view.u_calibration_deg == TILT.u_deg


def test_screws_that_work_the_other_way_round():
    view = advised(Aligning(ScrewMechanics(roll_sign=-1)), 0.2, -1.5)
    assert view.advice.direction == "out"


def test_aligned_is_said_of_settled_angles_alone():
    assert advised(Aligning(), 0.01, -0.02).advice.state == "aligned"
    assert advised(Aligning(), 0.01, -0.02, noise_deg=0.05, tilts=20).advice.state in ("too_noisy", "turn")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"trusted": False}, "while the load moves"),
        ({"calibration_id": None}, "recalibrate first"),
        ({"trusted": False, "calibration_id": None}, "recalibrate first"),
    ],
)
def test_no_advice_without_rest_or_record(changes, said):
    view = advised(Aligning(), 0.2, -1.5, **changes)
    assert (view.advice.state, view.advice.screw) == ("not_still", None)
    assert said in view.advice.text


def test_a_housing_that_lies_on_a_table_is_not_told_to_turn_screws():
    view = advised(Aligning(), 0.2, 89.0)
    assert view.advice.screw is None
    assert "does not hang" in view.advice.text


def test_angles_that_are_not_known_are_none():
    view = Aligning().add_samples(replace(TILT, pitch_deg=None))
    assert (view.pitch_deg, view.advice.state) == (None, "not_still")


def test_what_was_read_before_a_movement_is_forgotten():
    aligning = Aligning()
    advised(aligning, 0.2, -1.5)
    aligning.add_samples(replace(TILT, trusted=False))
    assert aligning.add_samples(TILT).advice.state == "not_still"
