"""Which effects can stand for others: of the same signature, with a value that a part has, and the causes that every rig has."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, Model
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.identifiability import (
    FittedRecording,
    distance_within,
    find_contributions,
    leaves_no_more,
    possible_changes,
    replace_implausible,
)
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.reconcile.output.serialisation import to_text
from gateway.twin.reconcile.reconcile import reconcile
from gateway.twin.reconcile.search.candidates import CandidateTable
from gateway.twin.reconcile.search.context import Budget, make_context
from gateway.twin.reconcile.search.validation import Validator
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.reconcile.conftest import RATE_HZ, RIG, swing

AT_PIVOT = replace(RIG, position_m=0.0)
OF_A_REAL_RIG: EffectValues = {
    "viscous_damping": {"damping_ratio": 0.008},
    "axis_offset": {"offset_g": (0.02, -0.015, 0.01)},
    "housing_position": {"error_m": 0.3},
    "lever_arm": {"offset_m": (0.04, 0.0)},
}
"""Four causes: a search of three effects ends before them."""


def with_unknown(observations: Observations, amplitude_g: float) -> Observations:
    """Add what no effect describes, so that a tilt of some degrees is no longer told from an offset by its second order."""
    time_s = observations.time_s
    unknown_g = amplitude_g * np.sin(2 * np.pi * (0.9 * time_s + 2.0 * np.sin(0.35 * time_s)))
    return replace(observations, force_g=observations.force_g + unknown_g[:, None] * [1.0, -1.0, 0.5])


def replaced(
    model: Model, record: Callable[..., Observations], hidden: EffectValues, unknown_g: float
) -> tuple[frozenset[str], bool]:
    """Names of the set that takes the place of an offset alone, and whether the offset is still a rival."""
    log, selection = (with_unknown(record(hidden, name), unknown_g) for name in ("log", "held_out"))
    context = make_context(model, log, Budget(), lambda: None)
    table = context.fit(CandidateTable(log), {})
    table = context.fit(table, {"axis_offset": {}})
    offset = table.fits[frozenset({"axis_offset"})]
    table, best = replace_implausible(table.start_round(), context, Validator(model.rig, {}, selection), offset)
    return best.names, table.get({"axis_offset"}) is not None


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_deg", "name"), [(10.0, "mount_misalignment"), (3.0, "axis_offset")])
def test_an_offset_no_part_has_beside_a_remainder_is_a_tilt(
    model: Model, record: Callable[..., Observations], tilt_deg: float, name: str
) -> None:
    found, is_rival = replaced(model, record, {"mount_misalignment": {"deg": (tilt_deg, 0.0)}}, 0.02)

    assert (set(found), is_rival) == ({name}, name == "axis_offset")


@pytest.mark.slow
def test_an_offset_no_part_has_stays_where_the_recording_tells_it_from_a_tilt(
    model: Model, record: Callable[..., Observations]
) -> None:
    hidden: EffectValues = {"axis_offset": {"offset_g": (0.2, 0.0, -0.05)}}

    assert replaced(model, record, hidden, 0.0) == (frozenset({"axis_offset"}), True)


def partners(model: EffectValues, name: str, others: tuple[str, ...], tilt_rad: float = 0.1) -> tuple[str, ...]:
    """Beside a remainder so large that whatever is within 0.1 rad of a contribution may be it."""
    initial = np.array([tilt_rad, tilt_rad / 2, 0.0, 0.0, 0.0])
    observations = swing(AT_PIVOT, model, initial, np.arange(0, 60, 1 / RATE_HZ), seed=None)
    recording = FittedRecording(observations, {}, initial, heading_is_fitted=False, excess_chi2=1e6)
    return find_contributions(AT_PIVOT, {}, model, others, [recording]).alike(name)


def test_distance_is_to_the_nearest_point_inside_the_bounds() -> None:
    columns = np.array([[2.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    target = np.array([6.0, 1.0, 4.0])
    wide, narrow = np.full(2, 10.0), np.array([1.0, 10.0])

    assert distance_within(target, columns, -wide, wide) == pytest.approx(4.0)
    assert distance_within(target, columns, -narrow, narrow) == pytest.approx(np.hypot(4.0, 4.0))
    assert distance_within(target, columns, np.zeros(2), np.zeros(2)) == pytest.approx(np.linalg.norm(target))


def test_values_stay_within_their_bounds_and_what_parts_have() -> None:
    model: EffectValues = {"viscous_damping": {"damping_ratio": 0.01}, "axis_offset": {"offset_g": (0.5, 0.0, 0.0)}}
    simulator = Simulator(AT_PIVOT, sorted(model))
    lower, upper = possible_changes(simulator, model, RIG)
    ends = {spec.label: (a, b) for spec, a, b in zip(simulator.parameters, lower, upper, strict=True)}

    assert ends["viscous_damping.damping_ratio"] == pytest.approx((-0.01, 0.49))
    # 60 mg by data sheets; the prior density falls by 20 of evidence within √20 quarters of it.
    assert ends["axis_offset.offset_g[y]"] == pytest.approx((-0.1271, 0.1271), abs=1e-4)
    assert ends["axis_offset.offset_g[x]"] == pytest.approx((-0.6271, 0.0), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_deg", "alternatives"), [(1.0, ("axis_offset", "cross_axis")), (9.7, ())])
def test_an_effect_that_needs_a_value_no_part_has_is_no_alternative(
    tilt_deg: float, alternatives: tuple[str, ...]
) -> None:
    """A small swing shows a tilt as an offset of its sine: 17 mg, which parts have, or 168 mg."""
    model: EffectValues = {"mount_misalignment": {"deg": (tilt_deg, 0.0)}}

    assert partners(model, "mount_misalignment", ("axis_offset", "cross_axis")) == alternatives


@pytest.mark.slow
def test_a_clock_is_no_alternative_of_a_loss_beside_a_length() -> None:
    """A clock and a length that are wrong together change the loss alone; to make all of it both would be far from true."""
    model: EffectValues = {"rope_length": {"relative_error": 0.001}, "viscous_damping": {"damping_ratio": 0.002}}

    assert partners(model, "viscous_damping", ("clock_drift",), tilt_rad=1.2) == ()
    assert partners(model, "rope_length", ("clock_drift",), tilt_rad=1.2) == ("clock_drift",)


def pairs_alike(nominal: EffectValues, fitted: EffectValues, name: str) -> tuple[tuple[str, str], ...]:
    initial = np.array([0.1, 0.05, 0.0, 0.05, 0.0])
    observations = swing(RIG, {**nominal, **fitted}, initial, np.arange(0, 60, 1 / RATE_HZ), seed=None)
    recording = FittedRecording(observations, nominal, initial, heading_is_fitted=False, excess_chi2=0.0)
    others = EFFECTS.choose(is_scored=True, needs_temperature=False)
    return find_contributions(RIG, nominal, fitted, others, [recording]).alike_pairs(name)


@pytest.mark.slow
def test_all_lengths_times_a_factor_are_a_clock() -> None:
    """Times of a pendulum whose lengths are longer by s are longer by √s; no other reading changes."""
    clock: EffectValues = {"clock_drift": {"relative": 0.01}}

    assert pairs_alike({}, clock, "clock_drift")[0] == ("housing_position", "rope_length")
    assert pairs_alike({}, {"viscous_damping": {"damping_ratio": 0.01}}, "viscous_damping") == ()


@pytest.mark.slow
def test_what_the_rig_states_is_no_contribution() -> None:
    stated: EffectValues = {"clock_drift": {"relative": 0.01}}
    initial = np.array([0.1, 0.05, 0.0, 0.05, 0.0])
    observations = swing(RIG, stated, initial, np.arange(0, 60, 1 / RATE_HZ), seed=None)
    recording = FittedRecording(observations, stated, initial, heading_is_fitted=False, excess_chi2=0.0)
    found = find_contributions(RIG, stated, stated, (), [recording])

    assert found.change == pytest.approx(0.0)


def with_remainder(checked: CheckedRecording, amplitude_g: float) -> CheckedRecording:
    """Add what no effect describes: a line along the rope whose frequency wanders."""
    observations = checked.observations
    assert observations is not None
    time_s = observations.time_s
    force_g = observations.force_g.copy()
    force_g[:, 2] += amplitude_g * np.sin(2 * np.pi * (1.3 * time_s + 2.0 * np.sin(0.35 * time_s)))
    return replace(checked, observations=replace(observations, force_g=force_g))


def known(found: Reconciliation) -> set[str]:
    return {*(effect.name for effect in found.effects), *found.candidates, *(n for g in found.also_one_of for n in g)}


def test_losses_and_errors_of_the_rig_are_usual_and_the_wind_is_not() -> None:
    usual = set(EFFECTS.choose(is_usual=True))

    assert {"viscous_damping", "axis_offset", "mount_misalignment", "rope_length"} <= usual
    assert not usual & {"steady_wind", "impact", "housing_spin", "double_pendulum", "clock_drift"}


def test_a_best_set_below_the_noise_bars_no_other() -> None:
    assert leaves_no_more(0.95, 0.94)
    assert leaves_no_more(6.88, 6.80)
    assert not leaves_no_more(9.0, 6.80)
    assert not leaves_no_more(1.2, 0.94)


@pytest.mark.slow
def test_causes_that_every_rig_has_are_named_beside_a_remainder(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    log, held_out = (with_remainder(loaded(OF_A_REAL_RIG, name), 1.5e-3) for name in ("log", "held_out"))
    found = reconcile(model, log, held_out)

    assert found.verdict in ("named_with_remainder", "one_of")
    assert {"viscous_damping", "axis_offset"} <= known(found)
    assert known(found) <= {*EFFECTS.choose(is_usual=True), "steady_wind", "cross_axis", "housing_rocking"}
    assert "without each of them far more is left" in to_text(found)


@pytest.mark.slow
def test_causes_that_every_rig_has_do_not_imitate_what_is_unknown(
    model: Model, loaded: Callable[..., CheckedRecording]
) -> None:
    log, held_out = (with_remainder(loaded({}, name), 4e-3) for name in ("log", "held_out"))
    found = reconcile(model, log, held_out)

    assert found.verdict == "unmodelled"
    assert not known(found)
