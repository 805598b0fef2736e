"""A document of one file as a browser shows it."""

from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, Page

Medium = Literal["screen", "print"]


def open_alone(browser: Browser, file: Path, width: int, medium: Medium) -> Page:
    """Open a document; it must ask for nothing, say nothing and fit the width."""
    page = browser.new_page(viewport={"width": width, "height": 800})
    asked: list[str] = []
    said: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.emulate_media(media=medium)
    page.goto(file.as_uri())
    assert [address for address in asked if not address.startswith("about:")] == [file.as_uri()]
    assert said == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    return page
