"""The report is one file that is whole, small, safe to open and the same for the same result."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.reconcile.output.result import Disagreement, NamedEffect
from gateway.twin.report.page import render_report
from tests.gateway.twin.report.conftest import TITLE, Maker
from tests.gateway.twin.report.report_page import CONTENTS, Page, html_of, plain_text
from tests.values import present

VERDICTS = ("data_unusable", "none_missing", "named", "one_of", "named_with_remainder", "unmodelled")
SECTIONS = [
    "verdict",
    "gap",
    "motion",
    "disagreement",
    "ranking",
    "parameters",
    "residual",
    "model",
    "data",
    "computed",
]
SHARP = "<script>alert(1)</script>&\"'$x_1$"
EVIL = f"{SHARP}\ud800"
"""With half a character, as a file's name may have."""


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


@pytest.mark.slow
def test_absent_contents_have_placeholders(make: Maker) -> None:
    result = make("named", steps=(), ranking=(), counts={})
    text = plain_text("".join(html_of(name, result) for name in (*CONTENTS, "data")))
    for said in ("No candidate was fitted.", "Samples were not counted."):
        assert said in text
    assert "None" not in text
    assert "nan" not in text


def test_computation_is_documented_in_the_order_given(make: Maker) -> None:
    page = render_report(
        make("data_unusable"), title="", software="plumbline 0.1.0", computed={"recording": "log.csv", "seed": "7"}
    )
    text = Page(page).sections["computed"]
    assert re.search(r"plumbline 0\.1\.0.*log\.csv.*seed7", text)


@pytest.mark.slow
def test_all_text_is_escaped(make: Maker) -> None:
    result = make("one_of")
    effect = NamedEffect(
        EVIL, EVIL, EVIL, {EVIL: replace(result.effects[0].parameters["accel_m_s2"], unit=EVIL)}, (1.0, 2.0)
    )
    compared = present(result.comparison)
    evil = replace(
        result,
        reason=EVIL,
        split_by=EVIL,
        effects=(effect,),
        candidates=(EVIL,),
        equations_before=(EVIL,),
        equations_after=(EVIL, EVIL + "2"),
        steps=tuple(replace(step, names=(SHARP,)) for step in result.steps),
        ranking=(replace(result.ranking[0], names=(EVIL,)),),
        comparison=replace(compared, disagreement=(Disagreement(EVIL, 1.0, 2.0, (0.1, 0.2), 3.0),)),
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
    short, long = present(result.comparison).log, 40
    log = replace(
        short,
        time_s=0.02 * np.arange(long * len(short.time_s), dtype=np.float64),
        used=np.tile(short.used, long),
        measured_g=np.tile(short.measured_g, (long, 1)),
        before_g=np.tile(short.before_g, (long, 1)),
        after_g=np.tile(short.after_g, (long, 1)),
    )
    assert len(html_of("motion", make("named", log=log, held_out=log)).encode()) < 800_000
