"""What no effect explains is told as an equation: in the text, in the JSON, in the report."""

import pytest

from gateway.twin.reconcile.output.estimates import Estimate, Law, LawTerm, Resemblance
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
