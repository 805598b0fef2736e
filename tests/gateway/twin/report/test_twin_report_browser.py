"""The report in a browser: it shows, asks for nothing, fits a phone and A4 paper."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from tests.document_in_browser import Medium, open_alone

pytestmark = pytest.mark.slow

A4_TEXT_PX = 688
"""182 mm at 96 dots to the inch."""


@pytest.fixture(scope="module")
def file(reports: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(reports["named"], encoding="utf-8")
    return path


@pytest.mark.parametrize(("width", "medium"), [(1000, "screen"), (360, "screen"), (A4_TEXT_PX, "print")])
def test_report_fits_and_loads_nothing(browser: Browser, file: Path, width: int, medium: Medium) -> None:
    page = open_alone(browser, file, width, medium)
    assert page.locator("figure svg").count() == 9
    assert page.locator(".answer").is_visible()
    box = page.locator("#gap svg").bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= width
    page.close()


def test_printed_report_cuts_no_figure(browser: Browser, file: Path) -> None:
    page = browser.new_page(viewport={"width": A4_TEXT_PX, "height": 1000})
    page.emulate_media(media="print")
    page.goto(file.as_uri())
    widths = page.evaluate("[...document.querySelectorAll('svg, table')].map(e => e.getBoundingClientRect().right)")
    page.close()
    assert max(widths) <= A4_TEXT_PX + 1
