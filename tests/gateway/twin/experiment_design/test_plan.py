"""What is told apart by which manoeuvre: known answers, the choice, and what is printed of it."""

import json

import pytest

from gateway.errors import InputError
from gateway.twin.experiment_design.candidates import CANDIDATES, FREE_SWING
from gateway.twin.experiment_design.experiment import Experiment, Run
from gateway.twin.experiment_design.hypotheses import GROUPS, Hypothesis, suspects
from gateway.twin.experiment_design.plan import Plan, forecast, plan
from gateway.twin.experiment_design.separation import SAME_TRACE, SEEN_SIGMA, Separation
from gateway.twin.experiment_design.text import as_json, as_text
from gateway.twin.model import TwinRig
from tests.values import present

RIG = TwinRig(length_m=12.0, position_m=5.0, sample_rate_hz=50.0)
TURNING = Experiment((Run(turn_deg_s=2.865),))
LATERAL, AXIAL, RATES, TURNS, DAMPING = GROUPS


Whole = tuple[Plan, list[str]]


@pytest.fixture(scope="module")
def whole() -> Whole:
    """All groups, planned once."""
    ticks: list[str] = []
    return plan(RIG, tick=ticks.append), ticks


def apart(text: str, manoeuvre: Experiment, rig: TwinRig = RIG) -> Separation:
    (found,) = forecast(rig, {}, manoeuvre, suspects(text))
    return found


@pytest.mark.slow
def test_wind_against_offset_is_one_trace_in_a_free_swing_and_two_with_a_turning_housing() -> None:
    assert apart("steady_wind,axis_offset[x+y]", FREE_SWING).cosine > 0.9995
    assert apart("steady_wind,axis_offset[x+y]", TURNING).cosine < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("group", [AXIAL, TURNS])
def test_what_no_manoeuvre_tells_apart_is_said_to_be_so(whole: Whole, group: tuple[Hypothesis, ...]) -> None:
    found = next(each for each in whole[0].groups if each.group == group)
    assert found.manoeuvre is None
    assert not found.is_distinguishable
    assert found.instead
    for manoeuvre in CANDIDATES:
        if not manoeuvre.inputs(RIG) & {suspect.effect for suspect in group}:
            (pair,) = forecast(RIG, {}, manoeuvre, group)
            assert pair.cosine > 0.9999


@pytest.mark.slow
def test_losses_are_much_alike_and_yet_told_apart(whole: Whole) -> None:
    found = next(each for each in whole[0].groups if each.group == DAMPING)
    assert found.is_distinguishable
    assert all(0.95 < pair.before.cosine < 0.998 for pair in found.pairs)


@pytest.mark.slow
def test_wind_wants_the_housing_turned(whole: Whole) -> None:
    found = whole[0].groups[0]
    assert found.is_distinguishable
    assert present(found.manoeuvre).inputs(RIG) == {"housing_spin"}
    wind = [pair for pair in found.pairs if pair.first == Hypothesis("steady_wind")]
    assert not any(pair.before.is_distinguishable for pair in wind)
    assert all(present(pair.after).cosine < 0.1 and present(pair.after).sigma > 100 for pair in wind)


@pytest.mark.slow
def test_a_longer_rope_and_a_slower_clock_are_one_trace_but_for_what_a_tape_measure_says(whole: Whole) -> None:
    """All lengths by a factor and time by its root: the same motion. So the plan asks for the tape measure."""
    found = next(each for each in whole[0].groups if each.group == RATES)
    assert not found.is_distinguishable
    assert found.pairs[0].before.cosine > SAME_TRACE
    assert present(found.instead).startswith("measure the rope")
    assert all(present(pair.after).is_distinguishable for pair in found.pairs[1:])


def test_no_separation_rests_on_a_rate_that_is_turned_by_hand() -> None:
    """With a rate known to the digit a wrong clock would show in it."""
    assert apart("rope_length,clock_drift", TURNING).cosine > SAME_TRACE


def test_more_noise_less_separation_and_the_same_angles() -> None:
    noisy = TwinRig(12.0, 5.0, noise_g=(4e-3,) * 3, sample_rate_hz=50.0)
    quiet, loud = (apart("viscous_damping,quadratic_drag", FREE_SWING, rig) for rig in (RIG, noisy))
    assert loud.sigma == pytest.approx(quiet.sigma / 4, rel=0.01)
    assert loud.cosine == pytest.approx(quiet.cosine, abs=1e-3)
    assert quiet.sigma > SEEN_SIGMA > loud.sigma
    assert not loud.is_distinguishable


@pytest.mark.slow
def test_what_the_operator_does_is_no_suspect() -> None:
    found = plan(RIG, [suspects("housing_spin,steady_wind")]).groups[0]
    assert found.tried < len(CANDIDATES)
    assert not present(found.manoeuvre).inputs(RIG) & {"housing_spin"}


def test_a_housing_at_the_pivot_is_not_hoisted_into_it() -> None:
    rig = TwinRig(12.0, 0.0, sample_rate_hz=50.0)
    assert FREE_SWING.possible(rig)
    assert not Experiment((Run(hoist_share=1 / 3),)).possible(rig)
    assert Experiment((Run(hoist_share=-1 / 3),)).possible(rig)


@pytest.mark.slow
def test_events_at_unknown_times_and_a_model_with_rigging() -> None:
    believed = {"double_pendulum": {"rigging_length_m": 2.0, "hook_mass_ratio": 0.05}}
    (pair,) = forecast(RIG, believed, FREE_SWING, suspects("wind_gust,trolley_acceleration"))
    assert 0.5 < pair.cosine < SAME_TRACE
    assert pair.is_distinguishable


@pytest.mark.slow
def test_the_text_says_what_to_do_how_long_and_what_comes_of_it(whole: Whole) -> None:
    text = as_text(whole[0])
    assert "turn the housing evenly about the rope meanwhile, one turn in 120 s; record 120 s" in text
    assert "takes: 2 min of recording, about 5 min in all" in text
    assert "expect: housing spin among the named effects: that is you" in text
    assert "manoeuvres tried tells these apart" in text
    assert "instead: repeat with the crane's slewing locked" in text


@pytest.mark.slow
def test_json_has_every_pair_before_and_after(whole: Whole) -> None:
    content = json.loads(json.dumps(as_json(whole[0]), allow_nan=False))
    lateral, axial = content["groups"][:2]
    assert lateral["effects"][1] == "axis_offset[x+y]"
    assert len(lateral["pairs"]) == 6
    assert lateral["pairs"][0]["before"]["cosine"] > lateral["pairs"][0]["after"]["cosine"]
    assert lateral["manoeuvre"]["recordings"][0]["model"] == {"housing_spin": {"rate_deg_s": 3.0}}
    assert axial["manoeuvre"] is None
    assert axial["pairs"][0]["after"] is None


@pytest.mark.slow
def test_progress_is_told_of_each_manoeuvre(whole: Whole) -> None:
    found, ticks = whole
    assert len(ticks) == sum(each.tried for each in found.groups)


def test_suspects_are_written_as_they_are_read() -> None:
    text = "steady_wind,axis_offset[x+y],cross_axis[xz]"
    assert ",".join(each.label for each in suspects(text)) == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("storm,steady_wind", "'storm' is no effect; known are axis_offset"),
        ("steady_wind", "name two or more"),
        ("steady_wind,steady_wind", "name two or more"),
        ("quantization,steady_wind", "quantization shows as a line, a lag or a lattice"),
        ("axis_offset[w],steady_wind", r"write axis_offset, or axis_offset\[...\] with some of x\+y\+z"),
        ("axis_offset[x,steady_wind", "write axis_offset"),
        ("wind_gust[start_s],steady_wind", r"with some of x\+y"),
    ],
)
def test_wrong_suspects_are_refused_with_the_mend(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        suspects(text)
