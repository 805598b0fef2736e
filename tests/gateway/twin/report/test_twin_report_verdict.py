"""The report states the verdict in words, and names no cause that the data do not prove."""

import pytest

from tests.gateway.twin.report.conftest import Maker
from tests.gateway.twin.report.report_page import Page, text_of


def test_unusable_data_give_no_answer_and_a_reason(pages: dict[str, Page]) -> None:
    found = pages["data_unusable"]
    assert "no answer" in found.sections["verdict"]
    assert "The recording lasts 3.2 s; record at least 60 s." in found.sections["verdict"]
    assert "do not take it for “all is well”" in found.sections["verdict"]
    assert list(found.sections) == ["verdict", "lacking", "data", "computed"]
    assert "svg" not in found.tags


@pytest.mark.slow
def test_none_missing_names_no_effect(pages: dict[str, Page]) -> None:
    found = pages["none_missing"]
    assert "No effect is missing" in found.sections["verdict"]
    assert "unchanged" in found.sections["verdict"]
    assert "viscous" not in found.sections["verdict"]
    assert "No effect was named" in found.sections["parameters"]


def test_named_effects_are_explained_with_time_and_gap(pages: dict[str, Page]) -> None:
    verdict = pages["named"].sections["verdict"]
    sentence = (
        "The nominal model lacks viscous damping and impact. With them, the simulation agrees with the measurement."
    )
    assert sentence in verdict
    assert "Something struck the load" in verdict
    assert "It acted at 36.6 s after the start of the recording" in verdict
    assert "Residual, recording15.2 → 0.995 × noise" in verdict


@pytest.mark.slow
def test_verdict_states_the_size_of_each_named_effect(pages: dict[str, Page]) -> None:
    verdict = pages["named"].sections["verdict"]
    assert "damping ratio 0.00500 (0.00450 to 0.00550)" in verdict
    assert "delta v x 0.200 m/s (0.180 to 0.220)" in verdict
    assert "delta v y 0.100 m/s (0.090 to 0.110)" in verdict
    assert "start" not in verdict.split("delta v y")[1].split("Check the crane")[0]  # the time is no size
    assert "damping ratio 0.00500" in pages["named_with_remainder"].sections["verdict"]
    assert "accel" not in pages["one_of"].sections["verdict"]  # no member of a group has a size of its own


@pytest.mark.slow
def test_ambiguity_group_names_no_cause_and_states_how_to_separate_it(pages: dict[str, Page]) -> None:
    found = pages["one_of"]
    verdict = found.sections["verdict"]
    assert "cannot distinguish them: steady wind, axis offset or mount misalignment." in verdict
    assert "The nominal model lacks" not in verdict
    assert "Turn the housing by 90° about the rope and record again." in verdict
    assert "Also identified: viscous damping" in verdict
    assert "steady wind – one of the group, as fitted; not an answer by itself" in found.sections["parameters"]


def test_ambiguity_group_without_a_separating_experiment_is_reported(make: Maker) -> None:
    result = make("one_of", split_by=None, effects=())
    assert "No experiment that would distinguish them was found." in text_of("verdict", result)


def test_further_groups_beside_a_remainder_are_reported(make: Maker) -> None:
    groups = {"candidates": ("coulomb_friction", "viscous_damping"), "also_one_of": (("axis_offset", "steady_wind"),)}
    partly = text_of("verdict", make("named_with_remainder", split_by="record a wider swing", **groups))
    assert "cannot distinguish them: coulomb friction or viscous damping." in partly
    assert "cannot distinguish them: axis offset or steady wind." in partly
    assert "To distinguish them: Record a wider swing." in partly

    group = text_of("verdict", make("one_of", **groups))
    assert group.count("coulomb friction or viscous damping") == 1  # in the headline alone
    assert "axis offset or steady wind" in group


def test_ambiguity_group_beside_a_remainder_does_not_explain_the_difference(make: Maker) -> None:
    beside = text_of("verdict", make("one_of", leaves_remainder=True))
    assert (
        "One of these effects acts, and this recording cannot distinguish them: steady wind, axis offset or" in beside
    )
    assert "A further effect is not known." in beside
    assert "Check what else acted on the load" in beside
    assert "further effect" not in text_of("verdict", make("one_of"))


@pytest.mark.slow
def test_final_model_is_no_answer_where_the_verdict_gives_none(make: Maker, pages: dict[str, Page]) -> None:
    assert "The others fit equally well, so it is not the answer" in pages["one_of"].sections["model"]
    attempt = text_of("model", make("unmodelled", comparison=make("named").comparison))
    assert "After: best attempt, not an explanation" in attempt
    assert "no claim to be the cause" in attempt
    assert "no claim" not in pages["unmodelled"].text
    assert "After: final model" in pages["named"].sections["model"]


@pytest.mark.slow
def test_remainder_is_described_and_not_named(pages: dict[str, Page]) -> None:
    found = pages["named_with_remainder"]
    assert "viscous damping, and a further effect that is not known" in found.sections["verdict"]
    assert (
        "1.2 % of the motion is left (34 % by the nominal model), mostly along the swing" in found.sections["verdict"]
    )
    assert "agrees with the measurement" not in found.sections["verdict"]
    assert "Not white." in found.sections["residual"]


@pytest.mark.slow
def test_unmodelled_effect_gets_no_name(pages: dict[str, Page]) -> None:
    verdict = pages["unmodelled"].sections["verdict"]
    assert "No effect in the catalogue explains the difference" in verdict
    assert (
        "mostly across the swing at 0.431 Hz, 2.1 mg; 30 % where the swing is wide, 10 % where it is small" in verdict
    )
    assert "The nominal model lacks" not in verdict
