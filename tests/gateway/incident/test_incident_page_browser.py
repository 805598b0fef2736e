"""The report in a browser: it fits a screen, a phone and A4 paper, and a screen reader finds its way."""

import re
from itertools import pairwise
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from gateway.incident.incident_report import IncidentReport
from tests.document_in_browser import Medium, open_alone

pytestmark = pytest.mark.slow

A4_POINTS = (595, 842)
A4_TEXT_PX = 711
"""188 mm at 96 dots to the inch."""


@pytest.fixture
def page_file(report: IncidentReport) -> Path:
    return report.folder / "incident.html"


@pytest.mark.parametrize(("width", "medium"), [(1280, "screen"), (360, "screen"), (A4_TEXT_PX, "print")])
def test_the_report_fits_and_loads_nothing(browser: Browser, page_file: Path, width: int, medium: Medium) -> None:
    page = open_alone(browser, page_file, width, medium)
    assert page.locator("figure svg").count() == 4
    certificate = page.frame_locator("iframe.certificate")
    assert certificate.locator("h1").inner_text() == "Calibration certificate"
    page.close()


def test_it_prints_on_a4_with_nothing_cut_off(browser: Browser, page_file: Path) -> None:
    page = browser.new_page(viewport={"width": A4_TEXT_PX, "height": 1000})
    page.emulate_media(media="print")
    page.goto(page_file.as_uri())
    right = page.evaluate(
        "[...document.querySelectorAll('svg, table, iframe')].map(e => e.getBoundingClientRect().right)"
    )
    pdf = page.pdf(prefer_css_page_size=True)
    page.close()
    assert max(right) <= A4_TEXT_PX + 1
    for box in set(re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)\s*\]", pdf)):
        assert [float(side) for side in box] == pytest.approx(A4_POINTS, abs=1.5)


def test_figures_have_a_text_tables_have_heads_and_headings_do_not_skip_a_level(
    browser: Browser, page_file: Path
) -> None:
    page = browser.new_page()
    page.goto(page_file.as_uri())
    assert page.evaluate("document.documentElement.lang") == "en"
    assert page.evaluate("[...document.querySelectorAll('svg')].filter(e => !e.getAttribute('aria-label')).length") == 0
    assert page.evaluate("[...document.querySelectorAll('iframe')].filter(e => !e.title).length") == 0
    heads = "[...document.querySelectorAll('table')].filter(e => !e.querySelector('thead th[scope=col]')).length"
    assert page.evaluate(heads) == 0
    levels = page.evaluate("[...document.querySelectorAll('h1, h2, h3')].map(e => +e.tagName[1])")
    page.close()
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
