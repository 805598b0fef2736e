"""The screen for aligning the housing, and the drift among the facts: advice only at rest, nothing unwatched shown as well."""

from dataclasses import replace
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from gateway.messages import NO_SESSION
from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

SIZES = [(800, 480), (1280, 800)]


@pytest.fixture
def screen(page: PageUnderTest, browser: Browser) -> Any:
    made = browser.new_page(viewport={"width": 800, "height": 480})
    made.goto(page.url)
    yield made
    made.close()


def test_the_larger_angle_first_then_the_other_until_both_are_aligned(gateway: FakeGateway, screen: Any) -> None:
    scene = gateway.scene
    scene.condition, scene.pitch_deg, scene.roll_deg = "static", 0.4, -1.5
    screen.locator("#to-service").click()
    screen.locator("#align-link").click()
    expect(screen.locator("#align-word")).to_have_text("ROLL IN")
    expect(screen.locator("#service-screen")).to_be_hidden()
    expect(screen.locator("#align-turns")).to_have_text("2.1 turns")
    expect(screen.locator("#align-pitch")).to_have_text("+0.40°")
    expect(screen.locator("#align-roll")).to_have_text("−1.50°")
    expect(screen.locator("#screws .wanted")).to_have_count(1)
    for width, height in SIZES:
        screen.set_viewport_size({"width": width, "height": height})
        root = "document.documentElement"
        over = f"[{root}.scrollWidth - {root}.clientWidth, {root}.scrollHeight - {root}.clientHeight]"
        assert screen.evaluate(over) == [0, 0]
        for part in ("align-word", "align-turns", "align-roll"):
            assert screen.evaluate(f"(e => e.scrollWidth - e.clientWidth)(document.getElementById('{part}'))") == 0
    scene.roll_deg = 0.01
    expect(screen.locator("#align-word")).to_have_text("PITCH OUT")
    scene.pitch_deg = -0.01
    expect(screen.locator("#align-word")).to_have_text("ALIGNED")
    expect(screen.locator("#align-known")).to_contain_text("±0.04°")
    expect(screen.locator("#screws .screw-arrow")).to_have_count(0)
    screen.locator("#align .go").click()
    expect(screen.locator("#service-screen")).to_be_visible()


def test_there_is_no_advice_without_a_reading_at_rest(gateway: FakeGateway, screen: Any) -> None:
    scene = gateway.scene
    screen.locator("#to-service").click()
    screen.locator("#align-link").click()
    expect(screen.locator("#align-word")).to_have_text("WAIT")
    expect(screen.locator("#align-text")).to_contain_text("no advice while the load moves")
    scene.condition, scene.roll_deg = "static", -1.5
    expect(screen.locator("#align-word")).to_have_text("ROLL IN")
    scene.session = replace(NO_SESSION, id="session-1", phase="collecting", method="six-position", suspended=True)
    expect(screen.locator("#calibration")).to_be_visible()
    expect(screen.locator("#align")).to_be_hidden()
    scene.session = NO_SESSION
    expect(screen.locator("#align")).to_be_visible()
    expect(screen.locator("#align-word")).to_have_text("ROLL IN")
    gateway.speaking.clear()
    expect(screen.locator("#align-word")).to_have_text("WAIT")
    expect(screen.locator("#align-text")).to_have_text("no readings")
    expect(screen.locator("#align-roll")).to_have_text("—")


def test_an_unknown_drift_is_never_shown_as_good(gateway: FakeGateway, screen: Any) -> None:
    fact = screen.locator("#fact-drift")
    expect(fact.locator("dd")).to_have_text("not known")
    gateway.scene.drift = {"state": "no_rest", "norm_error_mg": None, "limit_mg": None, "reasons": []}
    expect(fact.locator("dd")).to_have_text("not known")
    gateway.scene.drift = {"state": "watching", "norm_error_mg": -1.26, "limit_mg": 5.0, "reasons": []}
    expect(fact.locator("dd")).to_have_text("−1.3 / ±5.0 mg")
    expect(fact).not_to_have_class("bad")
    gateway.scene.drift = {"state": "alarm", "norm_error_mg": 9.0, "limit_mg": 5.0, "reasons": ["calibrate"]}
    expect(fact.locator("dd")).to_have_text("ALARM +9.0 mg")
    expect(fact).to_have_class("bad")


def test_the_drift_is_a_metric_once_it_is_known(gateway: FakeGateway, page: PageUnderTest) -> None:
    wait_until(lambda: page.state()["topics"].get("health"), "health")
    assert "drift" not in page.get("/metrics")[1]
    gateway.scene.drift = {"state": "alarm", "norm_error_mg": 9.0, "limit_mg": 5.0}
    wait_until(lambda: "plumbline_drift_alarm" in page.get("/metrics")[1], "the drift")
    assert "plumbline_drift_norm_error_g{" in page.get("/metrics")[1]
