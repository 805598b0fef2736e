"""The report states what the reconciliation holds and what it lacks, and is one file that is safe to open."""

import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from gateway.documents.environment import render
from gateway.twin.reconcile.output.estimates import NamedEffect
from gateway.twin.reconcile.output.result import Confusable, Disagreement, Peak, Reconciliation, Residual
from gateway.twin.report.page import MODEL_SECTIONS, render_report
from gateway.twin.report.provenance import computed_view, data_view
from gateway.twin.report.verdict import verdict_view

Maker = Callable[..., Reconciliation]
TITLE = "Crane 3 " + "x" * 200
VERDICTS = ("data_unusable", "none_missing", "named", "one_of", "named_with_remainder", "unmodelled")
VOID = {"meta", "br"}
SECTIONS = [
    "verdict",
    "gap",
    "motion",
    "disagreement",
    "ranking",
    "confusable",
    "parameters",
    "residual",
    "model",
    "data",
    "computed",
]
SHARP = "<script>alert(1)</script>&\"'$x_1$"
EVIL = f"{SHARP}\ud800"
"""With half a character, as a file's name may have."""


class Page(HTMLParser):
    """Elements must nest; text is collected by section."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.sections: dict[str, str] = {}
        self.tags: list[str] = []
        self.section = ""
        self.feed(text)
        self.close()
        assert not self.open
        self.sections = {name: " ".join(text.split()) for name, text in self.sections.items()}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        name = dict(attrs).get("id")
        if name is not None:
            self.ids.append(name)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "section":
            assert name is not None
            self.section = name
            self.sections[name] = ""

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.section and "style" not in self.open:
            self.sections[self.section] += data

    @property
    def text(self) -> str:
        return " ".join(self.sections.values())


class Pages(dict[str, Page]):
    """The parsed report of each verdict."""

    def __init__(self, reports: dict[str, str]) -> None:
        super().__init__()
        self._reports = reports

    def __missing__(self, verdict: str) -> Page:
        self[verdict] = Page(self._reports[verdict])
        return self[verdict]


@pytest.fixture(scope="module")
def pages(reports: dict[str, str]) -> Pages:
    return Pages(reports)


VIEWS = {name: view for name, _, view in MODEL_SECTIONS} | {"verdict": verdict_view, "data": data_view}


def html_of(name: str, result: Reconciliation) -> str:
    return render(f"report/{name}.html.j2", view=VIEWS[name](result))


def text_of(name: str, result: Reconciliation) -> str:
    return plain_text(html_of(name, result))


def plain_text(html: str) -> str:
    return Page(f'<section id="part">{html}</section>').text


@pytest.mark.slow
@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_gives_a_whole_page_with_unique_ids(pages: dict[str, Page], verdict: str) -> None:
    found = pages[verdict]
    assert len(found.ids) == len(set(found.ids))
    assert "script" not in found.tags
    assert all(text for text in found.sections.values())


@pytest.mark.slow
@pytest.mark.parametrize("verdict", VERDICTS[1:])
def test_sections_come_in_order(pages: dict[str, Page], verdict: str) -> None:
    assert list(pages[verdict].sections) == SECTIONS


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


@pytest.mark.slow
def test_model_with_effects_seen_in_the_samples_is_named_so(make: Maker, pages: dict[str, Page]) -> None:
    unchanged = replace(make("none_missing"), verdict="named", effects=make("named").effects[:1])
    assert "nominal model with the effects seen in the samples" in html_of("motion", unchanged)
    assert "nominal model, nothing added" in pages["none_missing"].sections["motion"]


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
    assert "Turn the housing by 90°" in found.sections["confusable"]
    assert "steady wind – one of the group, as fitted; not an answer by itself" in found.sections["parameters"]


def test_ambiguity_group_without_a_separating_experiment_is_reported(make: Maker) -> None:
    result = make("one_of", split_by=None, effects=())
    assert "No experiment that would distinguish them was found." in text_of("verdict", result)
    assert "No experiment that would separate the group was found." in text_of("confusable", result)


@pytest.mark.slow
def test_final_model_is_no_answer_where_the_verdict_gives_none(make: Maker, pages: dict[str, Page]) -> None:
    assert "The others fit equally well, so it is not the answer" in pages["one_of"].sections["model"]
    attempt = text_of("model", make("unmodelled", log=make("named").log))
    assert "After: best attempt, not an explanation" in attempt
    assert "no claim to be the cause" in attempt
    assert "no claim" not in pages["unmodelled"].text
    assert "After: final model" in pages["named"].sections["model"]


def test_effect_with_the_signature_of_a_named_one_is_reported(make: Maker) -> None:
    result = make("named")
    unique = "The signature of each named effect differs from those of all others in these data."
    assert unique in text_of("confusable", result)
    twin = replace(result, confusable=(Confusable("quadratic_drag", "viscous_damping", 0.9999),))
    text = text_of("confusable", twin)
    assert (
        "viscous damping has practically the same signature here as quadratic drag: only the fits above decide" in text
    )
    assert unique not in text


@pytest.mark.slow
def test_remainder_is_described_and_not_named(pages: dict[str, Page]) -> None:
    found = pages["named_with_remainder"]
    assert "viscous damping, and a further effect that is not known" in found.sections["verdict"]
    assert "0.131 Hz on x (2.1 mg)" in found.sections["verdict"]
    assert "agrees with the measurement" not in found.sections["verdict"]
    assert "Not white." in found.sections["residual"]


@pytest.mark.slow
def test_unmodelled_effect_gets_no_name(pages: dict[str, Page]) -> None:
    verdict = pages["unmodelled"].sections["verdict"]
    assert "No effect in the catalogue explains the difference" in verdict
    assert "0.431 Hz on x (2.1 mg), 0.860 Hz on z (0.40 mg)" in verdict
    assert "The nominal model lacks" not in verdict


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


def test_absence_of_transient_effects_from_the_score_test_is_explained(make: Maker) -> None:
    result = make("named")
    persistent = tuple(each for each in result.scores if each.name != "impact")
    assert "Transient effects are not in this list" in text_of("ranking", replace(result, scores=persistent))
    with_it = (replace(result.scores[0], name="impact"),)
    assert "not in this list" not in text_of("ranking", replace(result, scores=with_it))


def test_fitted_member_of_a_group_is_shown_without_a_claim(make: Maker) -> None:
    unnamed = make("one_of", effects=())
    assert "stand under “Model equations, before and after”, without any claim" in text_of("parameters", unnamed)
    assert "without any claim" not in text_of("parameters", make("none_missing"))


@pytest.mark.slow
def test_absent_contents_have_placeholders(make: Maker) -> None:
    result = make("named", steps=(), held_out=None, residual=None, scores=(), ranking=(), confusable=(), counts={})
    assert result.gap is not None
    not_evaluated = replace(
        result.gap, before_held_out=None, before_test=None, after_held_out=None, after_test=None, test_interval=None
    )
    text = plain_text("".join(html_of(name, replace(result, gap=not_evaluated)) for name in VIEWS if name != "verdict"))
    for said in (
        "No held-out recording was given.",
        "not evaluated on data to which it was not fitted",
        "held-out recordingselection, testnot evaluated",
        "nothing is known of its residual",
        "No effect was tested.",
        "No candidate was fitted.",
        "Effects were not compared",
        "Samples were not counted.",
    ):
        assert said in text
    verdict = Page(html_of("verdict", replace(result, gap=not_evaluated))).text
    assert "Residual, test part of the held-out recordingnot evaluated" in verdict
    assert "None" not in text + verdict
    assert "nan" not in text + verdict


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
    bare = text_of("motion", replace(result, held_out=None))
    assert "the last third of this one was held out" in bare


def test_residual_without_spectrum_has_placeholders(make: Maker) -> None:
    result = make("named", residual=Residual(False, float("nan"), (Peak(2.0, "z", 1e-3),), None), log=None)
    text = text_of("residual", result)
    assert "The spectrum of the residual was not computed." in text
    assert "The residual was not kept." in text
    assert "p not known" in text
    assert "2.000 Hzz, along the rope1.00 mg" in text


def test_computation_is_documented_in_the_order_given(make: Maker) -> None:
    view = computed_view(make("data_unusable"), "plumbline 0.1.0", {"recording": "log.csv", "seed": "7"})
    text = plain_text(render("report/computed.html.j2", view=view))
    assert re.search(r"plumbline 0\.1\.0.*log\.csv.*seed7", text)


@pytest.mark.slow
def test_all_text_is_escaped(make: Maker) -> None:
    result = make("one_of")
    effect = NamedEffect(
        EVIL, EVIL, EVIL, {EVIL: replace(result.effects[0].parameters["accel_m_s2"], unit=EVIL)}, (1.0, 2.0)
    )
    evil = replace(
        result,
        reason=EVIL,
        split_by=EVIL,
        effects=(effect,),
        candidates=(EVIL,),
        equations_before=(EVIL,),
        equations_after=(EVIL, EVIL + "2"),
        steps=tuple(replace(step, names=(SHARP,)) for step in result.steps),
        scores=(replace(result.scores[0], name=EVIL),),
        ranking=(replace(result.ranking[0], names=(EVIL,)),),
        confusable=(replace(result.confusable[0], first=EVIL, second=EVIL),),
        disagreement=(Disagreement(EVIL, 1.0, 2.0, (0.1, 0.2), 3.0),),
        refitted_on_held_out=(EVIL,),
        counts={EVIL: 1},
        model={EVIL: {EVIL: 1.0}},
    )
    html = render_report(evil, title=EVIL, software=EVIL, computed={EVIL: EVIL})
    html.encode()
    found = Page(html)
    assert "script" not in found.tags
    assert found.text.count("<script>") > 15


@pytest.mark.slow
def test_same_result_gives_the_same_bytes(make: Maker, reports: dict[str, str]) -> None:
    assert render_report(make("none_missing"), title=TITLE, software="plumbline 0.1.0") == reports["none_missing"]


@pytest.mark.slow
def test_report_of_a_long_recording_stays_small(make: Maker) -> None:
    result = make("named")
    assert result.log is not None
    long = 40
    log = replace(
        result.log,
        time_s=0.02 * np.arange(long * len(result.log.time_s), dtype=np.float64),
        used=np.tile(result.log.used, long),
        measured_g=np.tile(result.log.measured_g, (long, 1)),
        before_g=np.tile(result.log.before_g, (long, 1)),
        after_g=np.tile(result.log.after_g, (long, 1)),
    )
    assert len(html_of("motion", replace(result, log=log, held_out=log)).encode()) < 800_000
