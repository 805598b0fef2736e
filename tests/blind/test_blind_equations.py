"""Equations of what the catalogue does not hold: the campaign's rules, its published result, and a small fixed part of it."""

import json
from pathlib import Path

import pytest

from gateway.twin.reconcile.equation import FoundLaw
from tests.blind import equations
from tests.blind.cases import generate
from tests.blind.plan import Plan

RESULTS = Path(__file__).parent / "results"
LENGTHS_S = {"log": 36.0, "held_out": 24.0}
SEED = 7132


def law_of(hidden: str) -> FoundLaw | None:
    """The law beside the nominal model of a case."""
    plan = Plan(0, SEED, "outside" if hidden else "null", (hidden,) if hidden else ())
    return equations.find_law_of(generate(plan, LENGTHS_S))[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "term"),
    [
        ("negative_drag", "force_by_velocity"),
        ("driven_torsion", "periodic_rotation"),
        ("pivot_vibration", "pivot_sway"),
        ("guide_with_play", "force_with_dead_zone"),
        ("late_axes", "delayed_reading"),
        ("housing_spin", "steady_rotation"),
    ],
)
def test_hidden_law_is_found_as_its_term(hidden: str, term: str) -> None:
    law = law_of(hidden)
    assert law is not None
    assert law.terms[0] == term
    assert law.after.reduced_chi2 < 1.1


@pytest.mark.slow
def test_no_term_is_invented_where_nothing_is_hidden() -> None:
    assert law_of("") is None


@pytest.mark.parametrize(
    ("hidden", "named", "terms", "worth"),
    [
        ("negative_drag", [], ["force_by_velocity"], "right"),
        ("negative_drag", [], ["backlash", "force_by_velocity"], "wrong term"),
        ("negative_drag", [], [], "no term"),
        ("negative_drag", ["impact"], [], "wrong term"),
        ("", [], [], "none"),
        ("", [], ["backlash"], "invented"),
        ("viscous_damping", ["viscous_damping"], [], "none"),
        ("viscous_damping", ["viscous_damping"], ["constant_force"], "invented"),
    ],
)
def test_first_term_decides_what_an_answer_is_worth(
    hidden: str, named: list[str], terms: list[str], worth: str
) -> None:
    assert equations.score(hidden, named, terms) == worth


def test_plan_hides_each_law_eight_times_and_nothing_twenty_times() -> None:
    plans = equations.plan_laws(1)
    hidden = [plan.hidden for plan in plans]
    assert {name: hidden.count((name,)) for name in equations.RIGHT_TERMS} == dict.fromkeys(equations.RIGHT_TERMS, 8)
    assert hidden.count(()) == 20
    assert {names[0] for names in hidden if names} == {*equations.RIGHT_TERMS, *equations.KNOWN}


@pytest.mark.parametrize(("name", "count"), [("equations", 75), ("equations_command", 28)])
def test_published_campaign_has_seven_of_ten_right_and_no_term_invented(name: str, count: int) -> None:
    published = json.loads((RESULTS / f"{name}.json").read_text())
    plans = equations.plan_laws(published["seed"])
    rows = published["rows"]
    assert [row["index"] for row in rows] == list(range(count))
    assert all(plans[row["index"]].hidden == ((row["hidden"],) if row["hidden"] else ()) for row in rows)
    assert all(row["score"] == equations.score(row["hidden"], row["named"], row["terms"]) for row in rows)
    worth = [(row["hidden"] in equations.RIGHT_TERMS, row["score"]) for row in rows]
    assert worth.count((True, "right")) >= 0.7 * sum(is_law for is_law, _ in worth)
    assert (False, "invented") not in worth
