"""One sheet of A4, in a real browser, with nothing cut off and nothing loaded."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.page import render_certificate
from tests.gateway.certificate.conftest import make_record

pytestmark = pytest.mark.slow

A4_POINTS = (595, 842)


def printed(browser: Browser, path: Path, text: str) -> tuple[bytes, list[str], float]:
    """The PDF, all addresses asked for, and by how many pixels something is wider than the sheet."""
    path.write_text(text)
    asked: list[str] = []
    page = browser.new_page(viewport={"width": 850, "height": 1150})
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    page.emulate_media(media="print")
    wider = page.evaluate(
        "Math.max(...[...document.querySelectorAll('main *')].map(e => e.getBoundingClientRect().right))"
        " - document.querySelector('main').getBoundingClientRect().right"
    )
    pdf = page.pdf(prefer_css_page_size=True)
    page.close()
    return pdf, asked, wider


@pytest.fixture
def every(drifted: tuple[CalibrationRecord, CalibrationRecord], worst_record: CalibrationRecord) -> dict[str, str]:
    record, parent = drifted
    earlier = [make_record(id=f"p{month}", created_utc=f"2025-{month:02d}-01T00:00:00Z") for month in (3, 6, 9)]
    unfit = make_record(id="W" * 400, created_utc="2026-01-02T00:00:00Z")
    return {
        "without parent": render_certificate(make_record(method="six-position", temperature_c=None), None),
        "with parent": render_certificate(record, parent, earlier),
        "zero": render_certificate(make_record(method="zero", parent="parent-1", poses=[]), parent),
        "worst": render_certificate(worst_record, unfit, earlier),
        "worst measuring": render_certificate(
            worst_record.model_copy(update={"method": "norm-fit", "offset": [9e3, -4e3, 1.3e4]}), unfit, earlier
        ),
    }


def test_certificate_prints_on_one_sheet_of_a4(browser: Browser, every: dict[str, str], tmp_path: Path) -> None:
    for name, text in every.items():
        pdf, asked, wider = printed(browser, tmp_path / "page.html", text)
        assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1, name
        (box,) = set(re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)\s*\]", pdf))
        assert [float(side) for side in box] == pytest.approx(A4_POINTS, abs=1.5), name
        assert asked == [(tmp_path / "page.html").as_uri()], name
        assert wider <= 0.5, name
