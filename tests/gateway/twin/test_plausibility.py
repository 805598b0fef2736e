"""What a part can have, as a prior of the evidence."""

import math
from dataclasses import replace

import pytest

from gateway.pipeline.rig import Rig
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import TAIL_SHARE, limit_of
from gateway.twin.model import model_of
from gateway.twin.reconcile.search.candidates import implausibility
from tests.gateway.twin.swings import RIG

OFFSET, TILT = 0.136, 7.8
"""g and degrees: the same lean of a reading at rest."""


def offset(x_g: float) -> dict[str, dict[str, tuple[float, ...]]]:
    return {"axis_offset": {"offset_g": (x_g, 0.0, 0.0)}}


def test_values_within_the_limits_of_data_sheets_are_all_as_plausible() -> None:
    assert implausibility(offset(0.0), RIG) == implausibility(offset(-0.06), RIG) == 0.0
    assert implausibility({"viscous_damping": {"damping_ratio": 0.5}}, RIG) == 0.0


def test_density_beyond_a_limit_falls_as_a_normal_distribution() -> None:
    """136 mg of 60 mg: (76/15)^2; the ratio of two densities is exp of half the difference."""
    assert implausibility(offset(OFFSET), RIG) == pytest.approx(((0.136 - 0.06) / (TAIL_SHARE * 0.06)) ** 2)
    both = {"axis_offset": {"offset_g": (0.12, 0.0, -0.12)}}
    assert math.exp(-implausibility(both, RIG) / 2) == pytest.approx(math.exp(-8.0) ** 2)


def test_tilt_with_the_same_lean_is_more_plausible_than_an_offset_that_no_part_has() -> None:
    tilt = {"mount_misalignment": {"deg": (0.0, TILT)}}
    assert implausibility(offset(OFFSET), RIG) - implausibility(tilt, RIG) > 20.0


def test_friction_that_never_slides_within_a_swing_is_no_friction_that_a_pin_has() -> None:
    """Dahl's law is then a stiffness and a loss by the cube of the amplitude: a shorter rope and drag, under another name."""
    holds = EFFECTS["pivot_friction"]
    (_, presliding) = holds.parameters
    assert presliding.upper < 0.15
    assert implausibility({"pivot_friction": {"hold_rad": 6e-3, "presliding_rad": presliding.upper}}, RIG) > 20.0
    assert implausibility({"pivot_friction": {"hold_rad": 6e-3, "presliding_rad": 0.039}}, RIG) == 0.0


def test_limit_that_the_rig_states_replaces_the_usual_one() -> None:
    stated = replace(RIG, offset_limit_g=0.15, scale_limit=0.1)
    (offset_g,) = EFFECTS["axis_offset"].parameters
    assert limit_of(offset_g, stated) == 0.15
    assert implausibility(offset(OFFSET), stated) == 0.0
    assert implausibility({"scale_error": {"relative": (0.09, 0.0, 0.0)}}, stated) == 0.0
    assert implausibility({"scale_error": {"relative": (0.09, 0.0, 0.0)}}, RIG) > 20.0


def test_limits_follow_from_the_uncertainties_of_the_rig() -> None:
    """A rectangular distribution of standard uncertainty u ends at u sqrt(3)."""
    table = {"rope": {"length_m": 12.0}, "housing": {"position_m": 5.0}}
    stated = model_of(Rig.model_validate({**table, "sensor": {"offset_u_mg": [20.0, 20.0, 50.0], "scale_u": 0.01}})).rig
    assert stated.offset_limit_g == pytest.approx(0.05 * math.sqrt(3))
    assert stated.scale_limit == pytest.approx(0.01 * math.sqrt(3))
    silent = model_of(Rig.model_validate(table)).rig
    assert silent.offset_limit_g is silent.scale_limit is None


def test_every_limit_lies_inside_the_bounds() -> None:
    for effect in EFFECTS.values():
        for parameter in effect.parameters:
            if parameter.limit is not None:
                assert parameter.lower < parameter.neutral - parameter.limit
                assert parameter.neutral + parameter.limit < parameter.upper
