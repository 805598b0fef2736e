"""A browser window on the page, as an operator looks at it."""

import re
from typing import Any

from playwright.sync_api import Browser, Page, expect

PANEL, DESKTOP = (800, 480), (1280, 800)
CALM, RED = "rgb(211, 214, 217)", "rgb(193, 18, 31)"
"""Colours of the status."""


class Screen:
    """A browser window on the page, which remembers what went wrong and what was asked of whom."""

    def __init__(self, browser: Browser, url: str, size: tuple[int, int] = PANEL) -> None:
        self.page: Page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.errors: list[str] = []
        self.requested: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda line: self.errors.append(line.text))
        self.page.on("request", lambda request: self.requested.append(request.url))
        self.page.goto(url)

    def shows(self, word: str, shape: str) -> None:
        expect(self.page.locator("#word")).to_have_text(word)
        expect(self.page.locator("#shape")).to_have_attribute("href", f"#shape-{shape}")

    def text(self, selector: str, expected: str | re.Pattern[str]) -> None:
        expect(self.page.locator(selector)).to_have_text(expected)

    @property
    def band(self) -> Any:
        return self.page.locator(".status")
