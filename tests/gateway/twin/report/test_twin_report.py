"""The report says what the reconciliation holds, says what it lacks, and is one file that is safe to open."""

import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from gateway.twin.reconcile.output.result import Confusable, Disagreement, NamedEffect, Peak, Reconciliation, Residual
from gateway.twin.report import report
from gateway.twin.report.confusable import confusable_part
from gateway.twin.report.equations import equations_part
from gateway.twin.report.gap import gap_part
from gateway.twin.report.motion import motion_part
from gateway.twin.report.page import FOUND
from gateway.twin.report.parameters import parameters_part
from gateway.twin.report.provenance import computed_part, data_part
from gateway.twin.report.ranking import ranking_part
from gateway.twin.report.remaining import remaining_part
from gateway.twin.report.verdict import verdict_part

Maker = Callable[..., Reconciliation]
TITLE = "Crane 3 " + "x" * 200
VERDICTS = ("data_unusable", "none_missing", "named", "one_of", "named_with_remainder", "unmodelled")
VOID = {"meta", "br"}
PARTS = [
    "verdict",
    "gap",
    "motion",
    "disagreement",
    "ranking",
    "confusable",
    "parameters",
    "remaining",
    "model",
    "data",
    "computed",
]
SHARP = "<script>alert(1)</script>&\"'$x_1$"
EVIL = f"{SHARP}\ud800"
"""With half a character, as a file's name may have."""


class Page(HTMLParser):
    """Elements must nest; text is collected by section, pictures' drawing commands left out."""

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
        return " ".join(" ".join(self.sections.values()).split())


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


def text_of(html: str) -> str:
    """Of parts of a report."""
    parts = Page(f'<section id="parts">{html}</section>').sections.values()
    return " ".join(" ".join(parts).split())


@pytest.mark.slow
@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_is_a_whole_page_with_ids_of_its_own(pages: dict[str, Page], verdict: str) -> None:
    found = pages[verdict]
    assert len(found.ids) == len(set(found.ids))
    assert "script" not in found.tags
    assert all(text.strip() for text in found.sections.values())


@pytest.mark.slow
@pytest.mark.parametrize("verdict", VERDICTS[1:])
def test_the_parts_come_in_order(pages: dict[str, Page], verdict: str) -> None:
    assert list(pages[verdict].sections) == PARTS


def test_unusable_data_give_no_answer_and_say_why(pages: dict[str, Page]) -> None:
    found = pages["data_unusable"]
    assert "no answer" in found.sections["verdict"]
    assert "The recording lasts 3.2 s; record at least 60 s." in found.sections["verdict"]
    assert "do not take it for “all is well”" in found.sections["verdict"]
    assert list(found.sections) == ["verdict", "lacking", "data", "computed"]
    assert "svg" not in found.tags


@pytest.mark.slow
def test_nothing_missing_names_no_effect(pages: dict[str, Page]) -> None:
    found = pages["none_missing"]
    assert "Nothing is missing" in found.sections["verdict"]
    assert "the same before and after" in found.sections["verdict"]
    assert "viscous" not in found.sections["verdict"]
    assert "No effect was named" in found.sections["parameters"]


@pytest.mark.slow
def test_what_the_readings_themselves_show_is_not_called_nothing(make: Maker, pages: dict[str, Page]) -> None:
    unchanged = replace(make("none_missing"), verdict="named", effects=make("named").effects[:1])
    assert "model with what the readings themselves show" in motion_part(unchanged)
    assert "to which nothing was added" in pages["none_missing"].sections["motion"]


def test_named_effects_are_told_in_an_operators_words(pages: dict[str, Page]) -> None:
    verdict = pages["named"].sections["verdict"]
    assert "The simulation lacked viscous damping and impact. With them, it agrees with the measurement." in verdict
    assert "Something struck the load" in verdict
    assert "at 36.6 s after the start of the recording" in verdict
    assert "15.2 → 0.995 × noise" in verdict


@pytest.mark.slow
def test_one_of_a_group_names_none_and_tells_how_to_split_it(pages: dict[str, Page]) -> None:
    found = pages["one_of"]
    verdict = found.sections["verdict"]
    assert "cannot tell which: steady wind, axis offset or mount misalignment." in verdict
    assert "The simulation lacked" not in verdict
    assert "Turn the housing by 90° about the rope and record again." in verdict
    assert "Beside it, named for itself – viscous damping" in verdict
    assert "Turn the housing by 90°" in found.sections["confusable"]
    assert "steady wind – one of the group, as fitted; not an answer by itself" in found.sections["parameters"]


def test_a_group_that_nothing_splits_says_so(make: Maker) -> None:
    result = make("one_of", split_by=None, effects=())
    assert "No manoeuvre or measurement that would tell them apart was found." in text_of(verdict_part(result))
    assert "No manoeuvre or measurement that would split the group was found." in text_of(confusable_part(result))


@pytest.mark.slow
def test_the_model_after_is_no_answer_where_the_verdict_gives_none(make: Maker, pages: dict[str, Page]) -> None:
    assert "the others fit as well, so it is not the answer" in pages["one_of"].sections["model"]
    attempt = text_of(equations_part(make("unmodelled", log=make("named").log)))
    assert "After: best attempt, no explanation" in attempt
    assert "no claim to be the cause" in attempt
    assert "no claim" not in pages["unmodelled"].text
    assert "After: final model" in pages["named"].sections["model"]


def test_a_double_of_a_named_effect_is_told(make: Maker) -> None:
    result = make("named")
    assert "No named effect has a double in these data." in text_of(confusable_part(result))
    double = replace(result, confusable=(Confusable("quadratic_drag", "viscous_damping", 0.9999),))
    told = "viscous damping leaves practically the same trace here as quadratic drag: that it was named and not quadratic drag"
    assert told in text_of(confusable_part(double))


@pytest.mark.slow
def test_a_remainder_is_described_and_not_explained_away(pages: dict[str, Page]) -> None:
    found = pages["named_with_remainder"]
    assert "viscous damping – and something more that is not known" in found.sections["verdict"]
    assert "0.131 Hz on x (2.1 mg)" in found.sections["verdict"]
    assert "agrees with the measurement" not in found.sections["verdict"]
    assert "Not white." in found.sections["remaining"]


@pytest.mark.slow
def test_what_is_unmodelled_gets_no_name(pages: dict[str, Page]) -> None:
    verdict = pages["unmodelled"].sections["verdict"]
    assert "that no effect known to this program explains" in verdict
    assert "0.431 Hz on x (2.1 mg), 0.860 Hz on z (0.40 mg)" in verdict
    assert "The simulation lacked" not in verdict


def test_rivals_stand_out_in_the_ranking(make: Maker, pages: dict[str, Page]) -> None:
    assert "rival" not in pages["named"].sections["ranking"]
    result = make("named")
    best, second, last = result.ranking
    found = text_of(ranking_part(replace(result, ranking=(best, replace(second, behind=0.8, rival=True), last))))
    assert "coulomb friction and impact1.19not judged0.800rival: fits as well" in found


def test_the_best_with_a_trifle_more_is_not_the_best(make: Maker) -> None:
    result = make("named")
    best = result.ranking[0]
    bent = replace(best, names=(*best.names, "rope_length"), chi2_held_out=None, behind=0.0, rival=False)
    text = text_of(ranking_part(replace(result, ranking=(bent, best))))
    assert text.count("0 (best)") == 1
    assert text.index("0 (best)best") < text.index("what it adds is too little to count")


def test_parameters_have_components_intervals_units_and_doubts(make: Maker) -> None:
    result = make("named")
    impact = result.effects[1]
    doubtful = {name: replace(each, plausible=name != "delta_v_m_s") for name, each in impact.parameters.items()}
    text = text_of(parameters_part(replace(result, effects=(replace(impact, parameters=doubtful),))))
    assert "jump of velocity, x delta_v_m_s0.2000.180 to 0.220m/sdoubtful: at the edge of what is possible" in text
    assert "jump of velocity, y delta_v_m_s0.1000.090 to 0.110m/s" in text
    assert "It acted: at 36.6 s" in text


def test_an_event_without_a_known_time_says_so(make: Maker) -> None:
    result = make("named")
    text = text_of(parameters_part(replace(result, effects=(replace(result.effects[1], when_s=None),))))
    assert "When it acted is not known." in text


@pytest.mark.slow
def test_the_new_equation_is_marked(pages: dict[str, Page]) -> None:
    assert pages["named"].sections["model"].count("new ") == 1
    assert "new " not in pages["unmodelled"].sections["model"]
    assert "delta_v_m_s = [0.07, -0.11]" in pages["named"].sections["model"]


def test_symbols_of_the_equations_are_told(pages: dict[str, Page]) -> None:
    assert "a_p: acceleration of the pivot" in " ".join(pages["named"].sections["model"].split())


def test_what_is_fitted_again_is_told_in_words(make: Maker) -> None:
    text = text_of(data_part(make("named", refitted_on_held_out=("initial.tilt_x_rad", "vibration.phase_rad"))))
    assert "how far the rope leant along x at the start initial.tilt_x_rad" in text
    assert "vibration.phase_rad" in text


def test_events_are_not_missed_in_a_list_that_cannot_have_them(make: Maker) -> None:
    result = make("named")
    lasting = tuple(each for each in result.scores if each.name != "impact")
    assert "act for a while only are not in this list" in text_of(ranking_part(replace(result, scores=lasting)))
    with_it = (replace(result.scores[0], name="impact"),)
    assert "not in this list" not in text_of(ranking_part(replace(result, scores=with_it)))


def test_a_fitted_member_of_a_group_is_shown_without_a_claim(make: Maker) -> None:
    unnamed = make("one_of", effects=())
    assert "stands under “The model, before and after”, without any claim" in text_of(parameters_part(unnamed))
    assert "without any claim" not in text_of(parameters_part(make("none_missing")))


@pytest.mark.slow
def test_missing_parts_are_said(make: Maker) -> None:
    result = make("named", steps=(), held_out=None, residual=None, scores=(), ranking=(), confusable=(), counts={})
    assert result.gap is not None
    unjudged = replace(result.gap, before_held_out=None, after_held_out=None, held_out_interval=None)
    text = text_of("".join(part(replace(result, gap=unjudged)) for part in (verdict_part, *FOUND, data_part)))
    for said in (
        "No held-out recording was given.",
        "not judged on data that it had not seen",
        "Misses the held-out recording, not fitted to, bynot judged",
        "nothing is known of what remains",
        "No effect was tested.",
        "No candidate was fitted.",
        "Effects were not compared",
        "Samples were not counted.",
    ):
        assert said in text
    assert "None" not in text
    assert "nan" not in text


@pytest.mark.slow
def test_the_last_third_held_out_is_told_from_a_second_recording(make: Maker) -> None:
    result = make("named", held_out_is_last_third=True)
    assert "its last third, not fitted to" in text_of(verdict_part(result))
    assert "its last third (not fitted to)" in gap_part(result)
    text = text_of(motion_part(result))
    assert "The first two thirds of the recording, 0.0 s" in text
    assert "The last third of the recording, time counted anew" in text
    bare = text_of(motion_part(replace(result, held_out=None)))
    assert "the last third of this one was held out" in bare


def test_a_residual_without_spectrum_says_so(make: Maker) -> None:
    result = make("named", residual=Residual(False, float("nan"), (Peak(2.0, "z", 1e-3),), None), log=None)
    text = text_of(remaining_part(result))
    assert "spectrum was not computed" in text
    assert "The residual was not kept." in text
    assert "p not known" in text
    assert "2.000 Hzz, along the rope1.00 mg" in text


def test_how_it_was_computed_is_told_in_the_order_given(make: Maker) -> None:
    text = text_of(computed_part(make("data_unusable"), "plumbline 0.1.0", {"recording": "log.csv", "seed": "7"}))
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
        steps=tuple(replace(step, added=(SHARP,)) for step in result.steps),
        scores=(replace(result.scores[0], name=EVIL),),
        ranking=(replace(result.ranking[0], names=(EVIL,)),),
        confusable=(replace(result.confusable[0], first=EVIL, second=EVIL),),
        disagreement=(Disagreement(EVIL, 1.0, 2.0, (0.1, 0.2), 3.0),),
        refitted_on_held_out=(EVIL,),
        counts={EVIL: 1},
        model={EVIL: {EVIL: 1.0}},
    )
    html = report(evil, title=EVIL, software=EVIL, computed={EVIL: EVIL})
    html.encode()
    found = Page(html)
    assert "script" not in found.tags
    assert found.text.count("<script>") > 15


@pytest.mark.slow
def test_the_same_result_gives_the_same_bytes(make: Maker, reports: dict[str, str]) -> None:
    assert report(make("none_missing"), title=TITLE, software="plumbline 0.1.0") == reports["none_missing"]


@pytest.mark.slow
def test_a_long_recording_stays_small(make: Maker) -> None:
    result = make("named")
    assert result.log is not None
    long = 40
    log = replace(
        result.log,
        time_s=0.02 * np.arange(long * len(result.log.time_s), dtype=np.float64),
        used=np.tile(result.log.used, long),
        **{name: np.tile(getattr(result.log, name), (long, 1)) for name in ("measured_g", "before_g", "after_g")},
    )
    assert len(motion_part(replace(result, log=log, held_out=log)).encode()) < 800_000
