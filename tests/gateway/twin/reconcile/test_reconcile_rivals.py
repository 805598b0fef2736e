"""Which other models stay beside the best one, and which signatures are one."""

from types import SimpleNamespace

import numpy as np
import pytest

from gateway.twin.reconcile.decision.ambiguity_groups import is_superset_of_best
from gateway.twin.reconcile.decision.verdict import (
    Decision,
    RankedCandidate,
    competitive_models,
    decide_with_residual,
    remove_unidentifiable,
)
from gateway.twin.reconcile.residual.isolability import indistinguishable_pairs

ALIKE = frozenset({frozenset({"slewing", "housing_spin"})})


def contender(behind, *names):
    return RankedCandidate(SimpleNamespace(names=frozenset(names)), None, 0.0, behind)


def rivals(*others):
    best = contender(0.0, "housing_spin", "viscous_damping")
    return [sorted(each.names) for each in competitive_models([best, *others], ALIKE)[1:]]


def test_a_model_is_a_rival_as_long_as_the_odds_against_it_are_small():
    assert rivals(contender(11.9, "slewing")) == [["slewing"]]
    assert rivals(contender(12.1, "steady_wind")) == []


def test_effects_whose_signatures_coincide_stay_rivals_beside_the_same_others():
    assert rivals(contender(19.0, "slewing", "viscous_damping")) == [["slewing", "viscous_damping"]]
    assert rivals(contender(19.0, "slewing", "coulomb_friction")) == []
    assert rivals(contender(21.0, "slewing", "viscous_damping")) == []


def test_signatures_coincide_only_where_nothing_is_between_them():
    first = np.eye(9)[:, :1]
    near = first + 0.02 * np.eye(9)[:, 1:2]
    found = indistinguishable_pairs({"a": first, "b": -3 * first, "c": near, "d": np.eye(9)[:, 4:6]})
    assert found == {frozenset({"a", "b"})}


def answer(verdict, *names):
    return Decision(verdict, "", contender(0.0, *names), names, ())


def test_whether_the_crane_or_the_housing_turns_is_not_named():
    assert remove_unidentifiable(answer("named", "slewing")).candidates == ("housing_spin", "slewing")
    beside = remove_unidentifiable(answer("named", "impact", "slewing"))
    assert (beside.verdict, beside.named, beside.candidates) == ("one_of", ("impact",), ("housing_spin", "slewing"))
    more = remove_unidentifiable(answer("named_with_remainder", "housing_spin", "impact"))
    assert (more.verdict, more.named) == ("named_with_remainder", ("impact",))
    bare = remove_unidentifiable(answer("named_with_remainder", "housing_spin"))
    assert (bare.verdict, bare.named, bare.candidates) == ("unmodelled", (), ("housing_spin", "slewing"))


@pytest.mark.parametrize("verdict", ["named", "named_with_remainder"])
def test_a_turn_beside_a_pick_up_is_not_named(verdict):
    askew = remove_unidentifiable(answer(verdict, "cross_axis", "mount_misalignment", "wind_gust"))
    assert (askew.verdict, askew.named) == ("named_with_remainder", ("cross_axis", "wind_gust"))
    assert remove_unidentifiable(answer(verdict, "mount_misalignment")).named == ("mount_misalignment",)


@pytest.mark.parametrize(
    ("names", "beyond"),
    [
        ("slewing", True),
        ("housing_spin", False),
        ("slewing impact", True),
        ("housing_spin impact", True),
        ("impact", False),
        ("housing_spin viscous_damping", True),
    ],
)
def test_more_than_the_best_or_its_twin_is_no_rival(names, beyond):
    assert is_superset_of_best(frozenset(names.split()), frozenset({"slewing"})) == beyond
    assert not is_superset_of_best(frozenset({"impact", "rope_length"}), frozenset({"impact", "clock_drift"}))


def fitted(chi2, *names):
    attempt = SimpleNamespace(names=frozenset(names), fit=SimpleNamespace(chi2=chi2), reduced_chi2=chi2 / 1000)
    return RankedCandidate(attempt, SimpleNamespace(reduced_chi2=chi2 / 1000), 0.0, 0.0)


@pytest.mark.parametrize(("name", "named"), [("viscous_damping", True), ("clock_drift", False), ("rope_length", False)])
def test_a_pace_is_not_named_beside_what_nothing_explains(name, named):
    base, best = fitted(900_000.0), fitted(2_000.0, name)
    found = decide_with_residual(best, base, [best], frozenset(), {frozenset(): base.candidate}, wide=False)
    assert (found.verdict, found.named) == (("named_with_remainder", (name,)) if named else ("unmodelled", ()))
