"""Which sets of effects stay rivals of the best one, and which verdict the evidence gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.decision.evidence import Evidence, RankedCandidate, rivals_of
from gateway.twin.reconcile.decision.verdict import Decision, decide
from gateway.twin.reconcile.fit.multiple_shooting import Fit
from gateway.twin.reconcile.search.candidates import CandidateFit
from gateway.twin.reconcile.search.validation import ValidationFit


def ranked(evidence_deficit: float, *names: str, reduced_chi2: float = 1.0) -> RankedCandidate:
    force_g = np.zeros((300, 3))
    fit = Fit((), np.zeros(5), np.ones(5, dtype=bool), force_g, 900 * reduced_chi2, np.eye(5), np.zeros((300, 3, 5)))
    values: dict[str, dict[str, float | tuple[float, ...]]] = {name: {} for name in names}
    candidate = CandidateFit(values, fit, reduced_chi2, len(names), reduced_chi2 > 1.1)
    return RankedCandidate(candidate, ValidationFit(fit, reduced_chi2, ()), 0.0, evidence_deficit)


def evidence(best: RankedCandidate, *rivals: RankedCandidate, **facts: Any) -> Evidence:
    known: dict[str, Any] = {
        "best": best,
        "baseline": ranked(500.0, reduced_chi2=900.0),
        "rivals": [best, *rivals],
        "detected": frozenset(),
        "improves_selection": True,
        "best_leaves_excess": False,
        "baseline_leaves_excess": True,
        "necessary": best.names,
        "baseline_closes_gap": False,
        "share_closed": 0.999,
        "beyond_parts": frozenset(),
        "at_edge": frozenset(),
    }
    return Evidence(**(known | facts))


@pytest.fixture
def log() -> Observations:
    """White noise of the stated size about the candidates' prediction, 300 samples at 20 Hz."""
    noise = 1e-3 * np.random.default_rng(3).normal(size=(300, 3))
    return Observations(np.arange(300) / 20, noise, None, np.full(3, 1e-3), np.ones(300, dtype=bool))


@dataclass(frozen=True, slots=True)
class Alike:
    """Effects and pairs that could take the place of others, by name."""

    singles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    pairs: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)

    def alike(self, name: str) -> tuple[str, ...]:
        return self.singles.get(name, ())

    def alike_pairs(self, name: str) -> tuple[tuple[str, str], ...]:
        return self.pairs.get(name, ())


BY_YAW = Alike({"slewing": ("housing_spin",), "housing_spin": ("slewing",)})


def decided(log: Observations, found: Evidence, alike: Alike = BY_YAW) -> Decision:
    return decide(found, log, lambda: alike)


def rivals_beside(*others: RankedCandidate) -> list[list[str]]:
    best = ranked(0.0, "housing_spin", "viscous_damping")
    return [sorted(each.names) for each in rivals_of([best, *others])[1:]]


def test_a_set_is_a_rival_while_the_odds_against_it_are_small() -> None:
    assert rivals_beside(ranked(11.9, "slewing")) == [["slewing"]]
    assert rivals_beside(ranked(12.1, "steady_wind")) == []


def test_nothing_is_missing_where_the_best_set_is_the_baseline(log: Observations) -> None:
    base = ranked(0.0)
    found = decided(log, evidence(base, baseline=base, improves_selection=False))
    assert (found.verdict, found.named, found.reason.name) == ("none_missing", (), "NOTHING_MISSING")


def test_a_set_that_does_not_improve_the_selection_part_is_not_named(log: Observations) -> None:
    found = decided(log, evidence(ranked(0.0, "steady_wind"), improves_selection=False, baseline_leaves_excess=False))
    assert found.verdict == "none_missing"
    found = decided(log, evidence(ranked(0.0, "steady_wind"), improves_selection=False))
    assert found.verdict == "unmodelled"


@pytest.mark.parametrize(("closes", "verdict"), [(True, "named_with_remainder"), (False, "unmodelled")])
def test_what_the_samples_show_explains_only_what_it_closes(log: Observations, closes: bool, verdict: str) -> None:
    base = ranked(0.0, "quantization", reduced_chi2=9.0)
    found = decided(
        log,
        evidence(base, baseline=base, improves_selection=False, best_leaves_excess=True, baseline_closes_gap=closes),
    )
    assert (found.verdict, found.named) == (verdict, ("quantization",))


def test_an_effect_that_was_eliminated_again_is_not_named(log: Observations) -> None:
    baseline = ranked(90.0, "vibration", reduced_chi2=9.0)
    facts = {"baseline": baseline, "best_leaves_excess": True, "necessary": frozenset({"vibration", "impact"})}
    for found in (
        decided(log, evidence(ranked(0.0, "impact"), **facts)),
        decided(log, evidence(ranked(0.0, "impact"), **(facts | {"share_closed": 0.3}))),
    ):
        assert "vibration" not in found.named


def test_the_only_set_that_explains_the_data_is_named(log: Observations) -> None:
    found = decided(log, evidence(ranked(0.0, "impact", "viscous_damping")))
    assert (found.verdict, found.named) == ("named", ("impact", "viscous_damping"))


def test_nothing_is_named_for_good_on_a_value_at_its_edge_or_that_no_part_has(log: Observations) -> None:
    best = ranked(0.0, "pivot_friction", "axis_offset")
    edge = decided(log, evidence(best, at_edge=frozenset({"pivot_friction"})))
    assert (edge.verdict, edge.named, edge.reason.name) == ("named_with_remainder", ("axis_offset",), "DOUBTFUL")
    alone = decided(log, evidence(ranked(0.0, "pivot_friction"), at_edge=frozenset({"pivot_friction"})))
    assert (alone.verdict, alone.named) == ("unmodelled", ())
    large = decided(log, evidence(best, beyond_parts=frozenset({"axis_offset"})))
    assert (large.verdict, large.named) == ("named_with_remainder", ("axis_offset", "pivot_friction"))


def test_effects_detected_before_the_search_are_named_with_the_rest(log: Observations) -> None:
    found = decided(log, evidence(ranked(0.0, "viscous_damping"), detected=frozenset({"sample_loss"})))
    assert found.named == ("sample_loss", "viscous_damping")


def test_rivals_that_differ_in_one_effect_give_one_of(log: Observations) -> None:
    best, other = ranked(0.0, "impact", "rope_length"), ranked(3.0, "clock_drift", "impact")
    found = decided(log, evidence(best, other))
    assert (found.verdict, found.named, found.candidates) == ("one_of", ("impact",), ("rope_length", "clock_drift"))


def test_crane_and_housing_rotation_are_never_told_apart(log: Observations) -> None:
    alone = decided(log, evidence(ranked(0.0, "slewing")))
    assert (alone.verdict, alone.named, alone.candidates) == ("one_of", (), ("slewing", "housing_spin"))
    pair = decided(log, evidence(ranked(0.0, "impact", "slewing")))
    assert (pair.verdict, pair.named, pair.candidates) == ("one_of", ("impact",), ("slewing", "housing_spin"))


def test_an_ambiguity_group_that_closes_the_gap_is_told_beside_a_residual(log: Observations) -> None:
    residual = {"best_leaves_excess": True}
    more = decided(log, evidence(ranked(0.0, "housing_spin", "impact"), **residual))
    assert (more.verdict, more.named) == ("named_with_remainder", ("impact",))
    bare = decided(log, evidence(ranked(0.0, "housing_spin"), **residual))
    assert (bare.verdict, bare.named, bare.candidates) == ("one_of", (), ("housing_spin", "slewing"))
    assert bare.leaves_remainder
    base = ranked(90.0, "housing_spin", reduced_chi2=9.0)
    unknown = decided(log, evidence(base, baseline=base, improves_selection=False, **residual))
    assert (unknown.verdict, unknown.candidates) == ("unmodelled", ("housing_spin", "slewing"))
    assert unknown.reason.name == "NOT_EXPLAINED"
    open_gap = decided(log, evidence(ranked(0.0, "housing_spin"), **residual, share_closed=0.3))
    assert (open_gap.verdict, open_gap.known) == ("unmodelled", frozenset())


def test_a_group_beside_rivals_takes_the_place_of_neither(log: Observations) -> None:
    best, other = (ranked(each, name, "housing_spin") for each, name in ((0.0, "rope_length"), (3.0, "clock_drift")))
    found = decided(log, evidence(best, other))
    assert (found.verdict, found.named, found.candidates) == ("one_of", (), ("rope_length", "clock_drift"))
    assert found.also_one_of == (("housing_spin", "slewing"),)
    assert not found.leaves_remainder


PARTNERS = ("impact", "hoisting", "axis_offset", "cross_axis")
"""Effects with the same signature as another one, the most similar first; all come before it in the alphabet."""
CONTESTED = (("viscous_damping", "wind_gust"), ("steady_wind",), ("impact",), ("axis_offset",))
"""Rival sets, that with the most evidence first."""


@pytest.mark.parametrize("residual", [False, True])
def test_an_effect_stays_in_its_group_however_many_are_like_it(log: Observations, residual: bool) -> None:
    best = ranked(0.0, "viscous_damping")
    found = decided(log, evidence(best, best_leaves_excess=residual), Alike({"viscous_damping": PARTNERS}))
    assert (found.verdict, found.named) == ("one_of", ())
    assert found.candidates == ("viscous_damping", "impact", "hoisting", "axis_offset")


def test_of_many_contested_effects_those_of_the_best_sets_are_told(log: Observations) -> None:
    best, *others = (ranked(each, *names) for each, names in enumerate(CONTESTED))
    found = decided(log, evidence(best, *others))
    assert (found.verdict, found.candidates) == ("one_of", ("viscous_damping", "wind_gust", "steady_wind", "impact"))


@pytest.mark.parametrize(("name", "named"), [("viscous_damping", True), ("clock_drift", False), ("rope_length", False)])
def test_effects_that_scale_the_period_are_not_named_while_a_residual_remains(
    log: Observations, name: str, named: bool
) -> None:
    found = decided(log, evidence(ranked(0.0, name), best_leaves_excess=True))
    assert (found.verdict, found.named) == (("named_with_remainder", (name,)) if named else ("unmodelled", ()))


PARTLY = {"best_leaves_excess": True, "share_closed": 0.8}


def test_what_closes_most_of_the_gap_is_named_although_a_residual_remains(log: Observations) -> None:
    best = ranked(0.0, "viscous_damping", "axis_offset", reduced_chi2=9.0)
    found = decided(log, evidence(best, **PARTLY))

    assert (found.verdict, found.named) == ("named_with_remainder", ("axis_offset", "viscous_damping"))
    assert found.text.startswith("These effects close 80 % of the gap")
    assert decided(log, evidence(best, **(PARTLY | {"share_closed": 0.4}))).verdict == "unmodelled"


def test_beside_a_remainder_an_effect_is_not_named_that_is_idle_or_that_no_part_has(log: Observations) -> None:
    best = ranked(0.0, "viscous_damping", "axis_offset", "lever_arm", reduced_chi2=9.0)
    needed = {"necessary": frozenset({"viscous_damping", "axis_offset"}), "beyond_parts": frozenset({"axis_offset"})}
    assert decided(log, evidence(best, **PARTLY, **needed)).named == ("viscous_damping",)


@pytest.mark.parametrize(("name", "enough"), [("trolley_acceleration", 0.995), ("housing_rocking", 0.95)])
def test_what_few_rigs_have_is_named_beside_a_remainder_only_where_little_is_left(
    log: Observations, name: str, enough: float
) -> None:
    best = ranked(0.0, name, reduced_chi2=9.0)
    assert decided(log, evidence(best, **PARTLY)).verdict == "unmodelled"
    assert decided(log, evidence(best, **(PARTLY | {"share_closed": enough}))).named == (name,)


def test_effects_that_rivals_replace_are_candidates_beside_a_remainder(log: Observations) -> None:
    best = ranked(0.0, "viscous_damping", "axis_offset", reduced_chi2=9.0)
    rival = ranked(5.0, "coulomb_friction", "axis_offset", reduced_chi2=9.1)
    found = decided(log, evidence(best, rival, **PARTLY))

    assert (found.verdict, found.named) == ("named_with_remainder", ("axis_offset",))
    assert found.candidates == ("viscous_damping", "coulomb_friction")
    idle = decided(log, evidence(best, rival, **PARTLY, necessary=frozenset({"axis_offset"})))
    assert idle.candidates == ()


def test_an_answer_beside_a_remainder_may_have_two_groups(log: Observations) -> None:
    best = ranked(0.0, "viscous_damping", "axis_offset", reduced_chi2=9.0)
    rival = ranked(5.0, "coulomb_friction", "axis_offset", reduced_chi2=9.1)
    found = decided(log, evidence(best, rival, **PARTLY), Alike({"axis_offset": ("mount_misalignment",)}))

    assert (found.verdict, found.named) == ("one_of", ())
    assert found.candidates == ("viscous_damping", "coulomb_friction")
    assert found.also_one_of == (("axis_offset", "mount_misalignment"),)
    assert found.known == {"coulomb_friction", "viscous_damping", "axis_offset", "mount_misalignment"}
    assert found.leaves_remainder


def test_each_of_two_effects_that_nothing_separates_from_others_is_a_group(log: Observations) -> None:
    alike = Alike({"axis_offset": ("mount_misalignment",), "rope_length": ("clock_drift",)})
    found = decided(log, evidence(ranked(0.0, "axis_offset", "rope_length")), alike)
    assert (found.verdict, found.named) == ("one_of", ())
    assert found.candidates == ("axis_offset", "mount_misalignment")
    assert found.also_one_of == (("rope_length", "clock_drift"),)
    assert not found.leaves_remainder


def test_a_clock_is_one_of_a_group_with_all_distances_along_the_rope(log: Observations) -> None:
    alike = Alike(pairs={"clock_drift": (("housing_position", "rope_length"), ("rope_length", "scale_error"))})
    found = decided(log, evidence(ranked(0.0, "clock_drift")), alike)

    assert (found.verdict, found.named) == ("one_of", ())
    assert found.candidates == ("clock_drift", "housing_position", "rope_length")
    assert found.sets == (("clock_drift",), ("housing_position", "rope_length"))


def test_two_causes_that_add_up_to_a_named_one_are_stated_as_a_coincidence(log: Observations) -> None:
    alike = Alike(pairs={"rope_length": (("clock_drift", "housing_position"),)})
    found = decided(log, evidence(ranked(0.0, "rope_length")), alike)

    assert (found.verdict, found.named) == ("named", ("rope_length",))
    assert found.text.endswith("but for a coincidence: clock_drift with housing_position in place of rope_length.")


def test_sets_of_rivals_that_differ_in_several_effects_are_told(log: Observations) -> None:
    best, rival = ranked(0.0, "clock_drift"), ranked(3.0, "rope_length", "housing_position")

    assert decided(log, evidence(best, rival)).sets == (("clock_drift",), ("housing_position", "rope_length"))


def test_what_the_samples_show_is_no_explanation_of_a_remainder(log: Observations) -> None:
    baseline = ranked(90.0, "sample_hold", reduced_chi2=900.0)
    best = ranked(0.0, "viscous_damping", "sample_hold", reduced_chi2=9.0)
    facts = {"baseline": baseline, **PARTLY}
    found = decided(log, evidence(best, necessary=frozenset({"sample_hold"}), **facts))

    assert (found.verdict, found.named) == ("unmodelled", ("sample_hold",))
    assert decided(log, evidence(best, **facts)).verdict == "named_with_remainder"
