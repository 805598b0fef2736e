"""The sections of the report state what the reconciliation holds and what it lacks."""

from dataclasses import replace

import pytest

from gateway.twin.reconcile.output.result import Peak, Residual
from tests.gateway.twin.report.conftest import Maker
from tests.gateway.twin.report.report_page import Page, html_of, text_of


@pytest.mark.slow
def test_model_with_effects_seen_in_the_samples_is_named_so(make: Maker, pages: dict[str, Page]) -> None:
    unchanged = replace(make("none_missing"), verdict="named", effects=make("named").effects[:1])
    assert "nominal model with the effects seen in the samples" in html_of("motion", unchanged)
    assert "nominal model, nothing added" in pages["none_missing"].sections["motion"]


def test_rivals_are_marked_in_the_ranking(make: Maker, pages: dict[str, Page]) -> None:
    assert "rival" not in pages["named"].sections["ranking"]
    result = make("named")
    best, second, last = result.ranking
    found = text_of("ranking", replace(result, ranking=(best, replace(second, behind=0.8, rival=True), last)))
    assert "coulomb friction and impact1.19not evaluated0.800rival: fits equally well" in found


def test_best_set_with_an_insignificant_addition_is_not_the_best(make: Maker) -> None:
    result = make("named")
    best = result.ranking[0]
    larger = replace(best, names=(*best.names, "rope_length"), chi2_held_out=None, behind=0.0, rival=False)
    text = text_of("ranking", replace(result, ranking=(larger, best)))
    assert text.count("0 (best)") == 1
    assert text.index("0 (best)best") < text.index("the addition is not significant")


def test_parameters_have_components_intervals_units_and_plausibility(make: Maker) -> None:
    result = make("named")
    impact = result.effects[1]
    doubtful = {name: replace(each, plausible=name != "delta_v_m_s") for name, each in impact.parameters.items()}
    text = text_of("parameters", replace(result, effects=(replace(impact, parameters=doubtful),)))
    assert "jump of velocity, x delta_v_m_s0.2000.180 to 0.220m/sdoubtful: at the edge of what is possible" in text
    assert "jump of velocity, y delta_v_m_s0.1000.090 to 0.110m/s" in text
    assert "It acted: at 36.6 s" in text


def test_event_without_a_known_time_is_reported(make: Maker) -> None:
    result = make("named")
    text = text_of("parameters", replace(result, effects=(replace(result.effects[1], when_s=None),)))
    assert "When it acted is not known." in text


@pytest.mark.slow
def test_new_equation_is_marked(pages: dict[str, Page]) -> None:
    assert pages["named"].sections["model"].count("new ") == 1
    assert "new " not in pages["unmodelled"].sections["model"]
    assert "delta_v_m_s = [0.07, -0.11]" in pages["named"].sections["model"]


def test_symbols_of_the_equations_are_explained(pages: dict[str, Page]) -> None:
    assert "a_p: acceleration of the pivot" in pages["named"].sections["model"]


def test_refitted_parameters_are_explained(make: Maker) -> None:
    text = text_of("data", make("named", refitted_on_held_out=("initial.tilt_x_rad", "vibration.phase_rad")))
    assert "inclination of the rope along x at the start initial.tilt_x_rad" in text
    assert "vibration.phase_rad" in text


def test_fitted_member_of_a_group_is_shown_without_a_claim(make: Maker) -> None:
    unnamed = make("one_of", effects=())
    assert "stand under “Model equations, before and after”, without any claim" in text_of("parameters", unnamed)
    assert "without any claim" not in text_of("parameters", make("none_missing"))


@pytest.mark.slow
def test_held_out_last_third_is_distinguished_from_a_second_recording(make: Maker) -> None:
    result = make("named", held_out_is_last_third=True)
    assert "Residual, last third of the recording" in text_of("verdict", result)
    text = text_of("gap", result)
    assert "first two thirds of the recordingfit" in text
    assert "last third of the recordingselection" in text
    text = text_of("motion", result)
    assert "The first two thirds of the recording, 0.0 s" in text
    assert "The last third of the recording" in text


def test_lines_of_the_residual_are_listed(make: Maker) -> None:
    text = text_of("residual", make("named", residual=Residual(False, float("nan"), (Peak(2.0, "z", 1e-3),))))
    assert "p not known" in text
    assert "2.000 Hzz, along the rope1.00 mg" in text
