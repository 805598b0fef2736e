"""What the answer says in the text, in the JSON and in the report: a law, a best attempt, an effect of the same period."""

from dataclasses import replace

import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Equivalent, Estimate, Law, LawTerm, Resemblance
from gateway.twin.reconcile.output.serialisation import to_json, to_text
from gateway.twin.report.page import render_report
from tests.gateway.twin.report.conftest import Maker

LAW = Law(
    (
        LawTerm(
            "force_by_velocity",
            "force/mass = +0.0042 1/s v",
            "energy is fed in",
            {"coefficient": Estimate(0.0042, (0.0039, 0.0045), "1/s", "c", plausible=True)},
            ("force_by_speed_squared",),
            (Resemblance("viscous_damping", 0.9999, reversed=True),),
        ),
    ),
    beside=("axis_offset",),
    closed_test_percent=98.2,
)
MODEL = {"axis_offset": {"offset_g": (0.001, 0.0, 0.0)}, "force_by_velocity": {"coefficient": 0.0042}}


def test_text_says_the_equation_and_what_it_means(make: Maker) -> None:
    text = to_text(make("unmodelled", law=LAW, model=MODEL))
    assert "verdict      unmodelled: force/mass = +0.0042 1/s v (energy is fed in)\n" in text
    assert "coefficient = 0.0042 1/s (0.0039 to 0.0045)" in text
    assert "nearly as good: force_by_speed_squared" in text
    assert "resembles viscous_damping of the opposite sign (1.000)" in text
    assert "closes 98.2 % of the gap on the test part" in text


def test_json_has_terms_with_intervals_and_units(make: Maker) -> None:
    said = to_json(make("unmodelled", law=LAW, model=MODEL), 1.0)
    equation = said["equation"]
    (term,) = equation["terms"]
    assert term["parameters"]["coefficient"].items() >= {"value": 0.0042, "unit": "1/s"}.items()
    assert term["parameters"]["coefficient"]["ci95"] == [0.0039, 0.0045]
    assert term["closest_effects"] == [{"name": "viscous_damping", "cosine": 0.9999, "reversed": True}]
    assert equation["beside"] == ["axis_offset"]
    assert equation["closed_test_percent"] == 98.2
    assert said["best_attempt"] == {"axis_offset": {"offset_g": [0.001, 0.0, 0.0]}}


def test_without_a_law_the_equation_is_null(make: Maker) -> None:
    assert to_json(make("unmodelled", model={}), 1.0)["equation"] is None


@pytest.mark.slow
def test_report_describes_the_remainder_and_names_no_cause(make: Maker) -> None:
    page = render_report(make("unmodelled", law=LAW, model=MODEL), title="t", software="s")
    assert "An equation describes the remainder: force/mass = +0.0042 1/s v (energy is fed in)." in page
    assert "names no cause" in page


ATTEMPT = {"viscous_damping": {"damping_ratio": 0.004}, "axis_offset": {"offset_g": (0.001, -0.002, 0.0)}}


def test_the_best_attempt_is_told_where_nothing_explains_the_data(make: Maker) -> None:
    result = make("unmodelled", model=ATTEMPT)
    text = to_text(result)
    assert "best attempt viscous_damping (damping_ratio 0.004); axis_offset (offset_g 0.001,-0.002,0 g)" in text
    assert "not an explanation" in text
    assert to_json(result, 1.0)["best_attempt"] == {
        "viscous_damping": {"damping_ratio": 0.004},
        "axis_offset": {"offset_g": [0.001, -0.002, 0.0]},
    }


def test_named_effects_are_no_attempt(make: Maker) -> None:
    result = make("named", model=ATTEMPT)
    assert "best attempt" not in to_text(result)
    assert to_json(result, 1.0)["best_attempt"] == {}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "error", "same"), [("load_inertia", 0.02, "samples"), ("rope_mass", -0.02, "period")])
def test_equivalent_is_told_with_the_values_that_it_has(make: Maker, name: str, error: float, same: str) -> None:
    result = make("named", model={"rope_length": {"relative_error": error}})
    values = EFFECTS[name].equivalent_values({"relative_error": error}, 14.0)
    assert values is not None
    told = replace(result, equivalents=(Equivalent(name, "rope_length", values, "measure the rope"),))
    text = to_text(told)
    assert f"or equally   {name} ({next(iter(values))}" in text
    assert f"which gives the {same} of rope_length" in text
    assert "To distinguish them: Measure the rope" in render_report(told, title="t", software="s")
