"""Acknowledging on the page: over HTTP as a hostile peer would, and in a browser as an operator does."""

import http.client
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from gateway.atomic_io import partial_of
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.page.sign_in import most_wrong_attempts
from tests.gateway.page.conftest import PIN, FakeGateway, PageUnderTest, Services
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

ACKNOWLEDGE = "/api/acknowledge"
SIGN_IN = "/api/sign-in"
INCIDENT = {"incident": "b00t-1"}
NO_HEADERS: dict[str, str | None] = {}
Answer = tuple[int, dict[str, Any], str]


def _post(page: PageUnderTest, path: str, content: Any, headers: Mapping[str, str | None] = NO_HEADERS) -> Answer:
    """Post as the page's script does; a header that is None is left out. Status, content and cookie."""
    host = page.url.removeprefix("http://")
    usual: dict[str, str | None] = {"Host": host, "Origin": page.url, "Content-Type": "application/json"}
    body = content if isinstance(content, bytes) else json.dumps(content).encode()
    connection = http.client.HTTPConnection(host, timeout=PATIENCE_S)
    try:
        sent = {name: value for name, value in {**usual, **headers}.items() if value is not None}
        connection.request("POST", path, body, sent)
        response = connection.getresponse()
        text = response.read()
        decoded = json.loads(text) if response.getheader("content-type") == "application/json" else {}
        return response.status, decoded, response.getheader("set-cookie", "")
    finally:
        connection.close()


def _cookie(set_cookie: str) -> dict[str, str]:
    return {"Cookie": set_cookie.partition(";")[0]}


def _sign_in(page: PageUnderTest, name: str = "Ann", pin: str = PIN) -> Answer:
    return _post(page, SIGN_IN, {"name": name, "pin": pin})


def test_who_has_entered_the_pin_acknowledges_by_name(
    gateway: FakeGateway, page: PageUnderTest, services: Services
) -> None:
    gateway.scene.level = "trip"
    status, content, cookie = _sign_in(page)
    assert (status, content) == (200, {"name": "Ann"})
    port = page.url.rpartition(":")[2]
    assert cookie.startswith(f"plumbline_{port}=")
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
    assert PIN not in cookie
    status, content, _ = _post(page, ACKNOWLEDGE, INCIDENT, _cookie(cookie))
    assert (status, content) == (200, {"accepted": True, "text": "done"})
    assert [(request.by, request.incident) for request in services.requests] == [("Ann", "b00t-1")]
    status, content, _ = _post(page, ACKNOWLEDGE, {"incident": "b00t-9"}, _cookie(cookie))
    assert (status, content["accepted"]) == (409, False)
    assert "b00t-9" in content["text"]
    _post(page, "/api/sign-out", {}, _cookie(cookie))
    assert _post(page, ACKNOWLEDGE, INCIDENT, _cookie(cookie))[0] == 401


def test_nobody_acknowledges_without_the_pin(page: PageUnderTest, services: Services, pin_file: Path) -> None:
    assert _post(page, ACKNOWLEDGE, INCIDENT)[0] == 401
    assert _post(page, ACKNOWLEDGE, INCIDENT, {"Cookie": "plumbline_1=x"})[0] == 401
    cookie = _sign_in(page)[2]
    pin_file.write_text("27182818\n")
    assert _post(page, ACKNOWLEDGE, INCIDENT, _cookie(cookie))[0] == 401
    pin_file.unlink()
    assert _sign_in(page)[:2] == (503, {"error": "no_pin"})
    assert services.requests == []


def test_a_pin_is_void_after_many_wrong_ones_also_where_no_new_one_can_be_written_and_who_is_signed_in_stays(
    page: PageUnderTest, pin_file: Path
) -> None:
    cookie = _cookie(_sign_in(page)[2])
    obstacle = partial_of(pin_file)
    obstacle.mkdir()
    for number in range(most_wrong_attempts(PIN)):
        assert _sign_in(page, pin=f"{number:08d}")[:2] == (403, {"error": "pin_wrong"})
    assert _sign_in(page)[:2] == (503, {"error": "pin_void"})
    assert _post(page, ACKNOWLEDGE, INCIDENT, cookie)[0] == 409  # authorised; there is no such incident
    obstacle.rmdir()
    wait_until(lambda: pin_file.read_text().strip() != PIN, "a new PIN")
    assert _sign_in(page)[:2] == (403, {"error": "pin_wrong"})
    assert _post(page, ACKNOWLEDGE, INCIDENT, cookie)[0] == 409
    assert _sign_in(page, pin=pin_file.read_text().strip())[0] == 200


REFUSED: list[tuple[str, Any, dict[str, str | None], int]] = [
    ("another site's script", INCIDENT, {"Origin": "http://evil.com"}, 403),
    ("a form without an origin", INCIDENT, {"Origin": None}, 403),
    ("an opaque origin", INCIDENT, {"Origin": "null"}, 403),
    ("a form's type", INCIDENT, {"Content-Type": "text/plain"}, 415),
    ("no type", INCIDENT, {"Content-Type": None}, 415),
    ("a rebound name", INCIDENT, {"Host": "evil.com", "Origin": "http://evil.com"}, 421),
    ("a field too many", {"name": "Ann", "pin": PIN, "role": "service"}, {}, 400),
    ("control characters", {"name": "Ann\nBert", "pin": PIN}, {}, 400),
    ("a blank name", {"name": "  ", "pin": PIN}, {}, 400),
    ("no JSON", b"[" * 1000, {}, 400),
    ("a large body", b"x" * 10_000, {}, 413),
]


@pytest.mark.parametrize(
    ("content", "headers", "status"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED]
)
def test_what_does_not_come_from_the_page_is_refused(
    idle_page: PageUnderTest, content: Any, headers: dict[str, str | None], status: int
) -> None:
    assert _post(idle_page, SIGN_IN, content, headers)[0] == status


def _open(browser: Browser, page: PageUnderTest) -> Page:
    window = browser.new_context(viewport={"width": 800, "height": 480}).new_page()
    window.goto(page.url)
    return window


def _enter(window: Page, name: str = "Ann", pin: str = PIN) -> None:
    window.locator("#sign-in-name").fill(name)
    window.locator("#sign-in-pin").fill(pin)
    window.keyboard.press("Enter")


def test_an_operator_acknowledges_and_every_screen_shows_it(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    window, other = _open(browser, page), _open(browser, page)
    expect(window.locator("#word")).to_have_text("OK")
    expect(window.locator("#acknowledge")).to_be_hidden()
    gateway.scene.level = "warn"
    expect(window.locator("#acknowledge")).to_have_accessible_name("Acknowledge")
    window.locator("#acknowledge").click()
    expect(window.locator("#sign-in")).to_be_visible()
    expect(window.locator("#sign-in-submit")).to_have_text("Acknowledge")
    assert Axe().run(window).violations_count == 0
    _enter(window, pin="00000000")
    expect(window.locator("#sign-in-error")).to_have_text("The PIN is wrong.")
    _enter(window)
    for screen in (window, other):
        expect(screen.locator("#acknowledged")).to_have_text(re.compile(r"✓ \d\d:\d\d Ann"))
        expect(screen.locator("#acknowledge")).to_be_hidden()
    expect(window.locator("#sign-in")).to_be_hidden()
    window.locator("#to-alerts").click()
    expect(window.locator("#alert-rows td.by")).to_have_text(re.compile(r"✓ \d\d:\d\d Ann"))
    expect(window.locator("#person")).to_have_text("Signed in: Ann")
    expect(other.locator("#person")).to_have_text("Read-only")
    other.locator("#to-alerts").click()
    other.locator("#sign").click()
    expect(other.locator("#sign-in-submit")).to_have_text("Sign in")

    gateway.scene.level, gateway.scene.acknowledged_by = "trip", None  # a higher level
    window.locator("#to-swing").click()
    expect(window.locator("#acknowledge")).to_have_accessible_name("Acknowledge as Ann")
    window.keyboard.press("F8")
    expect(window.locator("#acknowledged")).to_have_text(re.compile(r"✓ \d\d:\d\d Ann"))
    expect(window.locator("#sign-in")).to_be_hidden()
    window.context.close()
    other.context.close()


def test_the_dialog_has_the_name_of_nobody_else(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    gateway.scene.level = "trip"
    window = _open(browser, page)
    window.locator("#acknowledge").click()
    _enter(window, "Ann")
    expect(window.locator("#acknowledge")).to_be_hidden()
    window.context.clear_cookies()  # her session has ended
    gateway.scene.acknowledged_by = None
    window.locator("#acknowledge").click()
    expect(window.locator("#sign-in-name")).to_be_focused()
    expect(window.locator("#sign-in-name")).to_have_value("")
    _enter(window, "Bert")
    expect(window.locator("#acknowledged")).to_have_text(re.compile(r"✓ \d\d:\d\d Bert"))
    window.context.close()


def test_a_panel_without_keys_offers_names_and_digits(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    window = _open(browser, page)
    window.locator("#acknowledge").click()
    window.locator("#sign-in-names button", has_text="Bert").click()
    for digit in PIN:
        window.locator("#keypad button", has_text=digit).click()
    box = present(window.locator("#sign-in").bounding_box())
    assert box["y"] >= 0
    assert box["y"] + box["height"] <= 480
    window.locator("#sign-in button[type=submit]").click()
    expect(window.locator("#acknowledged")).to_have_text(re.compile(r"✓ \d\d:\d\d Bert"))
    window.context.close()


def test_a_panel_without_keys_offers_letters_for_another_name(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    window = _open(browser, page)
    window.locator("#acknowledge").click()
    expect(window.locator("#sign-in-what")).to_have_text(re.compile(r"^Swing: limit \d\d:\d\d$"))
    window.locator("#sign-in-name").click()
    for letter in "JOX":
        window.locator("#keypad").get_by_role("button", name=letter, exact=True).click()
    window.locator("#keypad").get_by_role("button", name="delete").click()
    window.locator("#sign-in-pin").click()
    for digit in PIN:
        window.locator("#keypad button", has_text=digit).click()
    window.locator("#sign-in button[type=submit]").click()
    expect(window.locator("#acknowledged")).to_have_text(re.compile(r"✓ \d\d:\d\d JO$"))
    window.context.close()


def test_the_list_offers_a_button_for_an_alert_that_has_ended(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser, services: Services
) -> None:
    gateway.scene.level = "trip"
    window = _open(browser, page)
    expect(window.locator("#acknowledge")).to_be_visible()
    gateway.scene.level = "normal"
    expect(window.locator("#acknowledge")).to_be_hidden()
    window.locator("#to-alerts").click()
    window.locator("#sign").click()
    _enter(window)
    expect(window.locator("#alert-rows button")).to_have_accessible_name(
        re.compile(r"^Acknowledge as Ann: Swing: limit, \d\d:\d\d:\d\d$")
    )
    window.locator("#alert-rows button").click()
    wait_until(lambda: bool(services.requests), "the request")
    assert [request.incident for request in services.requests] == ["b00t-1"]
    window.context.close()


def test_the_list_offers_to_acknowledge_all_that_have_ended_at_once(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser, services: Services
) -> None:
    scene = gateway.scene
    window = _open(browser, page)
    window.locator("#to-alerts").click()
    for number in range(1, 4):
        expect(window.locator("#acknowledge-all")).to_be_visible(visible=number > 2)
        scene.incident, scene.level = f"b00t-{number}", "trip"
        expect(window.locator("#alert-rows tr")).to_have_count(number)
        scene.level = "normal"
        expect(window.locator("#alert-rows tr.standing")).to_have_count(0)
        expect(window.locator("#alerts-waiting")).to_have_text(str(number))
    window.locator("#acknowledge-all").click()
    _enter(window)
    expect(window.locator("#acknowledge-all")).to_have_accessible_name("Acknowledge all as Ann")
    wait_until(lambda: len(services.requests) == 3, "the requests")
    assert {request.incident for request in services.requests} == {"b00t-1", "b00t-2", "b00t-3"}
    window.context.close()


@pytest.mark.parametrize(("largest_deg", "shown"), [(7.6, "≥ 7.6°"), (4.6, "not known")])
def test_the_end_of_an_alarm_in_which_the_gateway_ended_is_not_known(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser, largest_deg: float, shown: str
) -> None:
    scene = gateway.scene
    window = _open(browser, page)
    scene.level, scene.largest_deg = "trip", largest_deg
    expect(window.locator("#word")).to_have_text("LIMIT")
    gateway.speaking.clear()
    expect(window.locator("#word")).to_have_text("STALE")
    scene.boot_id, scene.level = "b11t", "normal"
    gateway.speaking.set()
    expect(window.locator("#word")).to_have_text("OK")
    window.locator("#to-alerts").click()
    expect(window.locator("#alert-rows td.to")).to_have_text("not known")
    expect(window.locator("#alert-rows td.largest")).to_have_text(shown)
    window.context.close()


def test_the_tab_counts_what_ended_unacknowledged_also_before_a_start_of_the_gateway(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    scene = gateway.scene
    window = _open(browser, page)
    tab, badge = window.locator("#to-alerts"), window.locator("#alerts-waiting")
    expect(badge).to_be_hidden()
    for number, (incident, boot_id) in enumerate((("b00t-1", "b00t"), ("b11t-1", "b11t")), start=1):
        scene.incident, scene.boot_id, scene.level = incident, boot_id, "trip"
        expect(window.locator("#word")).to_have_text("LIMIT")
        scene.level = "normal"
        expect(badge).to_have_text(str(number))
        expect(tab).to_have_accessible_name(re.compile(f"^Alerts ?, not acknowledged: {number}$"))
    tab.click()
    expect(window.locator("#alert-rows td.by")).to_have_text(["Acknowledge", "Acknowledge"])
    window.locator("#alert-rows button").first.click()
    _enter(window)
    expect(window.locator("#alert-rows td.by")).to_have_text([re.compile(r"✓ \d\d:\d\d Ann"), "Acknowledge"])
    expect(badge).to_have_text("1")
    window.context.close()


def test_what_the_gateway_refuses_is_said(
    channel: PageChannel, gateway: FakeGateway, page: PageUnderTest, browser: Browser, services: Services
) -> None:
    gateway.scene.level = "trip"
    window = _open(browser, page)
    expect(window.locator("#acknowledge")).to_be_visible()
    services.scene = None
    window.locator("#acknowledge").click()
    _enter(window)
    expect(window.locator("#acknowledged")).to_contain_text("Not done: no incident b00t-1")
    window.context.close()


TONES = """() => import('/sound.js').then(({Sound}) => {
  const sound = Object.assign(Object.create(Sound.prototype), {alarms: new Map(), silenced: new Map()});
  const levels = [];
  for (const active of [[['a', 'warn']], [], [['a', 'trip']]]) { sound.alarms = new Map(active); levels.push(sound.level()); }
  return levels;
})"""


PLAYED = """() => import('/sound.js').then(({Sound}) => {
  const context = {currentTime: 0}, played = [];
  const sound = Object.assign(Object.create(Sound.prototype), {lastS: -Infinity, lastLevel: null, context});
  sound.tone = (frequency_hz) => played.push(frequency_hz);
  for (const [atS, level] of [[0, 'warn'], [0.5, 'warn'], [0.6, 'trip'], [0.7, 'trip'], [2.2, 'trip'], [2.5, 'warn']]) {
    context.currentTime = atS;
    sound.play(level);
  }
  return played;
})"""


def test_the_tone_of_a_higher_level_waits_for_no_pause(idle_page: PageUnderTest, browser: Browser) -> None:
    window = _open(browser, idle_page)
    assert window.evaluate(PLAYED) == [660, 550, *[880] * 6]
    window.context.close()


def test_an_acknowledged_alarm_is_silent_until_it_changes_to_a_higher_level(
    idle_page: PageUnderTest, browser: Browser
) -> None:
    window = _open(browser, idle_page)
    assert window.evaluate(TONES) == ["warn", None, "trip"]
    window.context.close()
