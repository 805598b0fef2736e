"""An effect that has the period of one of the answer is told beside it, in the text and in the report."""

from dataclasses import replace

import pytest

from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import Equivalent
from gateway.twin.reconcile.output.serialisation import to_text
from gateway.twin.report.page import render_report
from tests.gateway.twin.report.conftest import Maker


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
