"""Which other models stay beside the best one, and which signatures are one."""

from types import SimpleNamespace

import numpy as np
import pytest

from gateway.twin.reconcile.decision.ambiguity_groups import is_beyond
from gateway.twin.reconcile.decision.verdict import Answer, Contender, beside_a_remainder, rivals_of, told_apart
from gateway.twin.reconcile.residual.isolability import coinciding

ALIKE = frozenset({frozenset({"slewing", "housing_spin"})})


def contender(behind, *names):
    return Contender(SimpleNamespace(names=frozenset(names)), None, 0.0, behind)


def rivals(*others):
    best = contender(0.0, "housing_spin", "viscous_damping")
    return [sorted(each.names) for each in rivals_of([best, *others], ALIKE)[1:]]


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
    found = coinciding({"a": first, "b": -3 * first, "c": near, "d": np.eye(9)[:, 4:6]})
    assert found == {frozenset({"a", "b"})}


def answer(verdict, *names):
    return Answer(verdict, "", contender(0.0, *names), names, ())


def test_whether_the_crane_or_the_housing_turns_is_not_named():
    assert told_apart(answer("named", "slewing")).candidates == ("housing_spin", "slewing")
    beside = told_apart(answer("named", "impact", "slewing"))
    assert (beside.verdict, beside.named, beside.candidates) == ("one_of", ("impact",), ("housing_spin", "slewing"))
    more = told_apart(answer("named_with_remainder", "housing_spin", "impact"))
    assert (more.verdict, more.named) == ("named_with_remainder", ("impact",))
    bare = told_apart(answer("named_with_remainder", "housing_spin"))
    assert (bare.verdict, bare.named, bare.candidates) == ("unmodelled", (), ("housing_spin", "slewing"))


@pytest.mark.parametrize("verdict", ["named", "named_with_remainder"])
def test_a_turn_beside_a_pick_up_is_not_named(verdict):
    askew = told_apart(answer(verdict, "cross_axis", "mount_misalignment", "wind_gust"))
    assert (askew.verdict, askew.named) == ("named_with_remainder", ("cross_axis", "wind_gust"))
    assert told_apart(answer(verdict, "mount_misalignment")).named == ("mount_misalignment",)


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
    assert is_beyond(frozenset(names.split()), frozenset({"slewing"})) == beyond
    assert not is_beyond(frozenset({"impact", "rope_length"}), frozenset({"impact", "clock_drift"}))


def fitted(chi2, *names):
    attempt = SimpleNamespace(names=frozenset(names), fit=SimpleNamespace(chi2=chi2), reduced=chi2 / 1000)
    return Contender(attempt, SimpleNamespace(reduced=chi2 / 1000), 0.0, 0.0)


@pytest.mark.parametrize(("name", "named"), [("viscous_damping", True), ("clock_drift", False), ("rope_length", False)])
def test_a_pace_is_not_named_beside_what_nothing_explains(name, named):
    base, best = fitted(900_000.0), fitted(2_000.0, name)
    found = beside_a_remainder(best, base, [best], frozenset(), {frozenset(): base.attempt}, wide=False)
    assert (found.verdict, found.named) == (("named_with_remainder", (name,)) if named else ("unmodelled", ()))
