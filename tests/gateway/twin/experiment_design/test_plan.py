"""Which experiment separates which effects: known answers, the choice, and the output."""

import json

import pytest

from gateway.errors import InputError
from gateway.twin.experiment_design.experiment import CANDIDATES, FREE_SWING, Experiment, Run
from gateway.twin.experiment_design.plan import (
    MAX_COSINE,
    MIN_SEPARATION_SIGMA,
    GroupPlan,
    Plan,
    Separation,
    ambiguity_groups,
    as_json,
    as_text,
    forecast,
    plan,
)
from gateway.twin.experiment_design.signatures import Hypothesis, parse_hypotheses
from gateway.twin.model import TwinRig

RIG = TwinRig(length_m=12.0, position_m=5.0, sample_rate_hz=50.0)
TURNING = Experiment((Run(turn_deg_s=2.865),))
LATERAL = parse_hypotheses("steady_wind,mount_misalignment,cross_axis[xz+yz],axis_offset[x+y]")
AXIAL = parse_hypotheses("scale_error[z],axis_offset[z]")
PERIOD = parse_hypotheses("rope_length,clock_drift")
YAW = parse_hypotheses("housing_spin,slewing")
DAMPING = parse_hypotheses("viscous_damping,quadratic_drag,coulomb_friction")


@pytest.fixture(scope="module")
def whole() -> tuple[Plan, list[str]]:
    """The plan for all ambiguity groups, with its progress."""
    ticks: list[str] = []
    return plan(RIG, tick=ticks.append), ticks


def plan_of(whole: tuple[Plan, list[str]], group: tuple[Hypothesis, ...]) -> GroupPlan:
    return next(each for each in whole[0].groups if each.group == group)


def separation(text: str, experiment: Experiment, rig: TwinRig = RIG) -> Separation:
    (found,) = forecast(rig, {}, experiment, parse_hypotheses(text))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("rig", [RIG, TwinRig(30.0, 2.0, sample_rate_hz=50.0), TwinRig(6.0, 5.5, sample_rate_hz=20.0)])
def test_ambiguity_groups_are_those_of_the_physics(rig: TwinRig) -> None:
    """Tilts of the reading, the axial reading, the rate of the motion, rotation about the rope, losses of energy."""
    found = {frozenset(group) for group in ambiguity_groups(rig, {})}
    assert {frozenset(group) for group in (AXIAL, PERIOD, YAW)} <= found
    assert next(group for group in found if LATERAL[0] in group) == frozenset(LATERAL)
    losses = {effect for group in found for effect in group if effect in DAMPING}
    assert losses in (set(), set(DAMPING))  # losses of a housing at the load are below the noise


@pytest.mark.slow
def test_effects_that_an_ordinary_recording_separates_are_in_no_group() -> None:
    named = {hypothesis.effect for group in ambiguity_groups(RIG, {}) for hypothesis in group}
    assert named.isdisjoint({"thermal_drift", "lever_arm", "vibration", "wind_gust"})


@pytest.mark.slow
def test_small_swing_in_one_plane_does_not_tell_a_soft_clamp_from_a_wrong_position() -> None:
    """Both change the gain across the rope; they differ in the second order of the angle, and across the plane."""
    groups = [{hypothesis.effect for hypothesis in group} for group in ambiguity_groups(RIG, {})]
    assert {"housing_position", "housing_rocking"} in groups
    assert separation("housing_position,housing_rocking", FREE_SWING).cosine > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("other", ["rope_length", "clock_drift"])
def test_position_of_the_housing_is_separated_from_errors_of_the_period(other: str) -> None:
    assert separation(f"{other},housing_position", FREE_SWING).is_distinguishable


@pytest.mark.slow
def test_wind_and_offset_have_one_signature_in_a_free_swing_and_two_with_a_turning_housing() -> None:
    assert separation("steady_wind,axis_offset[x+y]", FREE_SWING).cosine > 0.9995
    assert separation("steady_wind,axis_offset[x+y]", TURNING).cosine < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("group", [AXIAL, YAW])
def test_pair_that_no_experiment_separates_gets_another_measurement(
    whole: tuple[Plan, list[str]], group: tuple[Hypothesis, ...]
) -> None:
    found = plan_of(whole, group)
    assert found.experiment is None
    assert not found.is_distinguishable
    assert found.instead
    for experiment in CANDIDATES:
        if not experiment.inputs(RIG) & {hypothesis.effect for hypothesis in group}:
            (pair,) = forecast(RIG, {}, experiment, group)
            assert pair.cosine > 0.9999


@pytest.mark.slow
def test_losses_have_similar_signatures_and_are_separated(whole: tuple[Plan, list[str]]) -> None:
    found = plan_of(whole, DAMPING)
    assert found.is_distinguishable
    assert all(0.95 < pair.before.cosine < 0.998 for pair in found.pairs)


@pytest.mark.slow
def test_wind_is_separated_by_turning_the_housing(whole: tuple[Plan, list[str]]) -> None:
    found = plan_of(whole, LATERAL)
    assert found.is_distinguishable
    assert found.experiment is not None
    assert found.experiment.inputs(RIG) == {"housing_spin"}
    wind = [pair for pair in found.pairs if pair.first == Hypothesis("steady_wind")]
    assert not any(pair.before.is_distinguishable for pair in wind)
    assert all(pair.after is not None and pair.after.cosine < 0.1 and pair.after.sigma > 100 for pair in wind)


@pytest.mark.slow
def test_rope_length_and_clock_drift_are_separated_by_a_tape_measure_only(whole: tuple[Plan, list[str]]) -> None:
    """All lengths by a factor and time by its root: the same motion."""
    found = plan_of(whole, PERIOD)
    assert not found.is_distinguishable
    assert found.pairs[0].before.cosine > MAX_COSINE
    assert found.instead is not None
    assert found.instead.startswith("measure the rope")


def test_separation_does_not_rest_on_a_rate_that_is_turned_by_hand() -> None:
    """With a rate that is known exactly, a wrong clock would show in it."""
    assert separation("rope_length,clock_drift", TURNING).cosine > MAX_COSINE


def test_noise_reduces_the_separation_and_keeps_the_angle() -> None:
    noisy = TwinRig(12.0, 5.0, noise_g=(4e-3,) * 3, sample_rate_hz=50.0)
    quiet, loud = (separation("viscous_damping,quadratic_drag", FREE_SWING, rig) for rig in (RIG, noisy))
    assert loud.sigma == pytest.approx(quiet.sigma / 4, rel=0.01)
    assert loud.cosine == pytest.approx(quiet.cosine, abs=1e-3)
    assert quiet.sigma > MIN_SEPARATION_SIGMA > loud.sigma
    assert not loud.is_distinguishable


@pytest.mark.slow
def test_input_of_the_operator_is_no_hypothesis() -> None:
    found = plan(RIG, [parse_hypotheses("housing_spin,steady_wind")]).groups[0]
    assert found.tried < len(CANDIDATES)
    assert found.experiment is not None
    assert not found.experiment.inputs(RIG) & {"housing_spin"}


def test_housing_at_the_pivot_is_not_hoisted_into_it() -> None:
    rig = TwinRig(12.0, 0.0, sample_rate_hz=50.0)
    assert FREE_SWING.is_possible(rig)
    assert not Experiment((Run(hoist_share=1 / 3),)).is_possible(rig)
    assert Experiment((Run(hoist_share=-1 / 3),)).is_possible(rig)


@pytest.mark.slow
def test_events_at_unknown_times_are_separated_in_a_model_with_rigging() -> None:
    model_effects = {"double_pendulum": {"rigging_length_m": 2.0, "hook_mass_ratio": 0.05}}
    (pair,) = forecast(RIG, model_effects, FREE_SWING, parse_hypotheses("wind_gust,trolley_acceleration"))
    assert 0.5 < pair.cosine < MAX_COSINE
    assert pair.is_distinguishable


@pytest.mark.slow
def test_text_states_what_to_do_how_long_and_what_it_separates(whole: tuple[Plan, list[str]]) -> None:
    text = as_text(whole[0])
    assert "meanwhile turn the housing evenly about the rope, one turn in 120 s; record 120 s" in text
    assert "takes: 2 min of recording, about 5 min in all" in text
    assert "expect: housing spin among the named effects, because you do it" in text
    assert "experiments tried separates these effects" in text
    assert "instead: repeat with the crane's slewing locked" in text
    assert "instead: turn the sensor upside down at rest" in text


@pytest.mark.slow
def test_json_has_every_pair_before_and_after(whole: tuple[Plan, list[str]]) -> None:
    content = json.loads(json.dumps(as_json(whole[0]), allow_nan=False))
    lateral = next(each for each in content["groups"] if "steady_wind" in each["effects"])
    axial = next(each for each in content["groups"] if "axis_offset[z]" in each["effects"])
    assert lateral["effects"][3] == "axis_offset[x+y]"
    assert len(lateral["pairs"]) == 6
    assert lateral["pairs"][0]["before"]["cosine"] > lateral["pairs"][0]["after"]["cosine"]
    assert lateral["manoeuvre"]["recordings"][0]["model"] == {"housing_spin": {"rate_deg_s": 3.0}}
    assert axial["manoeuvre"] is None
    assert axial["pairs"][0]["after"] is None


@pytest.mark.slow
def test_errors_of_the_sensor_that_no_experiment_separates_need_a_calibration() -> None:
    noisy = TwinRig(12.0, 5.0, noise_g=(0.1,) * 3, sample_rate_hz=50.0)
    (found,) = plan(noisy, [parse_hypotheses("axis_offset[x+y],cross_axis[xz+yz]")]).groups
    assert found.experiment is None
    assert found.instead is not None
    assert found.instead.startswith("take the sensor off the rope and calibrate it")


@pytest.mark.slow
def test_progress_counts_each_experiment(whole: tuple[Plan, list[str]]) -> None:
    found, ticks = whole
    assert len(ticks) == sum(each.tried for each in found.groups)


def test_hypotheses_are_written_as_they_are_read() -> None:
    text = "steady_wind,axis_offset[x+y],cross_axis[xz]"
    assert ",".join(each.label for each in parse_hypotheses(text)) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("storm,steady_wind", "'storm' is no effect; known are axis_offset"),
        ("steady_wind", "name two or more"),
        ("steady_wind,steady_wind", "name two or more"),
        ("quantization,steady_wind", "quantization shows in the samples or in their spectrum"),
        ("axis_offset[w],steady_wind", r"write axis_offset, or axis_offset\[...\] with some of x\+y\+z"),
        ("axis_offset[x,steady_wind", "write axis_offset"),
        ("wind_gust[start_s],steady_wind", r"with some of x\+y"),
    ],
)
def test_wrong_hypotheses_are_refused_with_the_correction(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_hypotheses(text)
