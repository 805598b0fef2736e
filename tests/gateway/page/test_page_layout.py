"""The layout of every screen in every state, size and language: nothing is cut, nothing overlaps, nothing is too small."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from gateway.languages import LANGUAGES, read_texts
from gateway.messages import NO_SESSION, SessionPose
from gateway.page.channel import CraneDirections
from tests.gateway.page.conftest import FakeGateway, PageUnderTest, ShownPage, open_page
from tests.gateway.scene import Scene
from tests.values import present
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

PANEL, DESKTOP, PHONE, SMALL_PHONE = (800, 480), (1280, 800), (390, 844), (320, 568)
SMALLEST_TEXT_PX = 15.9  # 16, with a rounding error of the unit
DIRECTIONS = {
    "en": CraneDirections(plus_x="trolley out", minus_x="trolley in", plus_y="bridge right", minus_y="bridge left"),
    "de": CraneDirections(
        plus_x="Katze hinaus", minus_x="Katze herein", plus_y="Brücke rechts", minus_y="Brücke links"
    ),
}
INSPECTION = Path(__file__).with_name("layout.js").read_text(encoding="utf-8")


def _trip(scene: Scene) -> None:
    scene.level, scene.phi_max_deg, scene.coverage95_deg = "trip", 12.4, [11.8, 13.0]
    scene.state, scene.hoist_m_s = "hoisting", -0.5


def _trip_by_wind_uncalibrated(scene: Scene) -> None:
    _trip(scene)
    scene.calibration, scene.state = "uncalibrated", "wind"
    scene.recording_error = "no space left on device; " * 4


def _faulty(scene: Scene) -> None:
    """Every fault at once: the disk is full, the bus is down, the page's PIN cannot be made, the relay does not switch."""
    scene.recording_error = "no space left on device; " * 4
    scene.standing_faults = {
        "recording": scene.recording_error,
        "bus": "bus: tls/10.0.0.2:7447: nobody answers there; is the gateway running, and its bus.listen the same?",
        "relay": "gpiochip0 line 17: the command did not end; the relay may not follow the alerts",
        "page_pin": "/var/lib/plumbline/page-pin: read-only file system; nobody can acknowledge on the page",
    }


def _acknowledged(scene: Scene) -> None:
    _trip_by_wind_uncalibrated(scene)
    scene.acknowledged_by = "Maximiliane Hohenzollern-Wartenberg"


def _unknown(scene: Scene) -> None:
    scene.coverage95_deg = scene.swinging = None
    scene.motion_codes = ["implausible_mean"]


def _suspended(scene: Scene) -> None:
    pose = SessionPose(face="+x", count=300, used=True)
    scene.session = replace(
        NO_SESSION,
        id="session-1",
        phase="collecting",
        method="six-position",
        by="ann",
        poses=[pose],
        wanted=6,
        next_face="-x",
        next_direction=[-1.0, 0.0, 0.0],
        suspended=True,
        hints=["pose_off_face", "pose_not_still"],
    )


def _holding(scene: Scene) -> None:
    _suspended(scene)
    scene.session = replace(scene.session, still=True, seconds_left=9.4)


def _uncalibrated(scene: Scene) -> None:
    scene.calibration = "uncalibrated"


def _disturbed(scene: Scene) -> None:
    scene.condition, scene.trusted = "disturbed", False
    scene.codes = ["norm_hanging", "explained", "rate_pendulum"]


STATES: dict[str, Callable[[Scene], None]] = {
    "OK": lambda scene: None,
    "OK with faults of the gateway": _faulty,
    "TRIP": _trip,
    "TRIP with other findings": _trip_by_wind_uncalibrated,
    "TRIP acknowledged": _acknowledged,
    "UNKNOWN": _unknown,
    "SUSPENDED": _suspended,
    "SUSPENDED while a pose is taken": _holding,
    "UNCALIBRATED": _uncalibrated,
    "DISTURBED": _disturbed,
}


@pytest.fixture(scope="module", params=LANGUAGES)
def shown_page(request: pytest.FixtureRequest, browser: Browser) -> Iterator[ShownPage]:
    """One for all states: a process of the page and a window for each take longer than what is looked at."""
    language = str(request.param)
    with open_page(browser, language=language, directions=DIRECTIONS.get(language, DIRECTIONS["en"])) as shown:
        window = shown.screen.page
        window.add_init_script(INSPECTION)
        window.reload()
        expect(window.locator("html")).to_have_attribute("lang", language)
        yield shown


in_english = pytest.mark.parametrize("shown_page", ["en"], indirect=True)


def _show(page: ShownPage, state: str, size: tuple[int, int] = PANEL, screen: str = "") -> Page:
    """Bring a state to the window, in this size and on this screen."""
    window, scene = page.screen.page, Scene()
    STATES[state](scene)
    page.show(scene, state.split(maxsplit=1)[0])
    _resize(window, size)
    window.evaluate("(hash) => { location.hash = hash; }", screen)
    return window


def _resize(window: Page, size: tuple[int, int]) -> None:
    window.set_viewport_size({"width": size[0], "height": size[1]})


@pytest.mark.parametrize("state", STATES)
def test_no_text_is_cut_in_any_state(shown_page: ShownPage, state: str) -> None:
    window = _show(shown_page, state)
    for size in (PANEL, DESKTOP, PHONE, SMALL_PHONE):
        _resize(window, size)
        for screen in ("", "#alerts", "#service"):
            window.evaluate("(hash) => { location.hash = hash; }", screen)
            expect(window.locator(f"#to-{screen[1:] or 'swing'}")).to_have_attribute("aria-current", "page")
            window.wait_for_timeout(250)
            assert window.evaluate("layout.cut()") == [], (size, screen)
            scrolls = size in (PHONE, SMALL_PHONE) or screen == "#service"  # a phone and the service screen scroll
            assert window.evaluate("(acrossOnly) => layout.outside(acrossOnly)", scrolls) == [], (size, screen)


TOO_LONG = """(sentences) => {
  const shown = document.getElementById('sentence'), tried = shown.cloneNode();
  Object.assign(tried.style, {position: 'absolute', width: `${shown.clientWidth}px`});
  shown.after(tried);
  const found = sentences.filter((told) => { tried.textContent = told; return tried.scrollHeight > tried.clientHeight + 2; });
  tried.remove();
  return found;
}"""


GONE = ("gateway_gone", "page_gone", "page_slow", "page_silent", "no_new_data", "reason_no_samples")
"""What is said beside the last limit where nothing comes any more."""


def test_every_sentence_of_an_alarm_has_two_lines_at_most(shown_page: ShownPage) -> None:
    window = _show(shown_page, "TRIP")
    texts = read_texts(str(window.locator("html").get_attribute("lang")))
    standing = [
        f"{texts[f'do_{level}']} {texts[form]} {texts[other]}".replace("{limit}", texts[f"at_{level}"])
        for level in ("warn", "trip")
        for form in ("alarm_exceeded", "alarm_possible", "alarm_coming", "alarm_unknown")
        for other in ("also_lean", "also_calibration")
    ]
    standing += [f"{texts['do_trip']} {texts[gone]}" for gone in GONE]
    ending = [
        f"{texts[form]} {texts[follows]}".replace("{limit}", texts[f"at_{level}"])
        for level in ("warn", "trip")
        for form in ("alarm_exceeded_passed", "alarm_corrected_passed", "alarm_passed")
        for follows in ("warn_below", "warn_in", "normal_below", "normal_in", "also_lean", "alarm_stays")
    ]
    sentences = [text.replace("{angle}", "13.5°") for text in standing + ending]
    assert window.evaluate(TOO_LONG, [text.format(seconds=3) for text in sentences]) == []


EDGES = """(at) => {
  document.querySelector('#gauge .warn').style.setProperty('--at', at);
  const spans = [...document.querySelectorAll('#gauge .mark span')], boxes = [...spans, document.getElementById('gauge')];
  return boxes.map((box) => box.getBoundingClientRect()).map(({left, right}) => [left, right]);
}"""


@pytest.mark.parametrize("warning_at", ["4cqw", "65cqw"])
def test_the_names_of_the_limits_stay_apart(shown_page: ShownPage, warning_at: str) -> None:
    window = _show(shown_page, "OK")
    expect(window.locator("#gauge .mark.warn span")).to_be_visible()
    for size in (PANEL, DESKTOP, PHONE, SMALL_PHONE):
        _resize(window, size)
        warning, limit, gauge = window.evaluate(EDGES, warning_at)
        assert gauge[0] <= warning[0] < warning[1] < limit[0] < limit[1] <= gauge[1] + 1, size


def test_the_dialog_fits_every_size(shown_page: ShownPage) -> None:
    window = _show(shown_page, "TRIP")
    window.locator("#acknowledge").click()
    window.locator("#sign-in-name").fill("Ann")
    window.keyboard.press("Enter")
    expect(window.locator("#sign-in-error")).not_to_be_empty()
    for size in (PANEL, DESKTOP, PHONE, SMALL_PHONE):
        _resize(window, size)
        window.wait_for_timeout(100)
        assert window.evaluate("layout.cut()") == [], size
        is_phone = size in (PHONE, SMALL_PHONE)
        assert window.evaluate("(acrossOnly) => layout.outside(acrossOnly)", is_phone) == [], size
        for deciding in ("#word", "#sentence", "#phi", "#interval"):
            assert not _overlap(window, "#sign-in", deciding), (size, deciding)
    window.keyboard.press("Escape")
    expect(window.locator("#sign-in")).to_be_hidden()


def test_the_button_has_room_for_the_name_of_who_acknowledges(shown_page: ShownPage) -> None:
    window, name = shown_page.screen.page, "Maximiliane Hohenzollern-Wartenberg"
    window.route("**/api/session", lambda route: route.fulfill(json={"name": name, "available": True}))
    window.reload()
    _show(shown_page, "TRIP with other findings")
    for size in (PANEL, DESKTOP, PHONE, SMALL_PHONE):
        _resize(window, size)
        expect(window.locator("#acknowledge-as")).to_contain_text(name)
        window.wait_for_timeout(250)
        assert window.evaluate("layout.cut()") == [], size
        assert window.evaluate("(acrossOnly) => layout.outside(acrossOnly)", size in (PHONE, SMALL_PHONE)) == [], size
        for other in ("#sound", "#sentence", "#word", "#also"):
            assert not _overlap(window, "#acknowledge", other), (size, other)
    window.unroute("**/api/session")
    window.reload()


BOXES = """(selectors) => selectors.map((selector) => {
  const {left, right, top, bottom} = document.querySelector(selector).getBoundingClientRect();
  return {left, right, top, bottom};
})"""


def _overlap(window: Page, *selectors: str) -> bool:
    first, second = window.evaluate(BOXES, selectors)  # both at one moment: a new sentence moves what is below it
    across = first["left"] < second["right"] and second["left"] < first["right"]
    return bool(across and first["top"] < second["bottom"] and second["top"] < first["bottom"])


def _height(window: Page, selector: str) -> float:
    return float(present(window.locator(selector).first.bounding_box())["height"])


def test_names_are_as_high_as_keys(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    _trip(gateway.scene)
    window = browser.new_page(viewport={"width": PANEL[0], "height": PANEL[1]})
    window.goto(page.url)
    window.locator("#acknowledge").click()
    for size in (PANEL, PHONE):
        _resize(window, size)
        key = _height(window, "#keypad button")
        assert _height(window, "#sign-in-names button") == pytest.approx(key, rel=0.05)


LONGEST_ROW = """() => {
  document.querySelector('#alert-rows td.to').textContent = 'unbekannt';
  document.querySelector('#alert-rows td.by').textContent = '✓ 17:12 Maximiliane Hohenzollern-Wartenberg';
}"""


@pytest.mark.parametrize("size", [PHONE, SMALL_PHONE])
def test_a_phone_shows_alerts_and_their_buttons_at_once(shown_page: ShownPage, size: tuple[int, int]) -> None:
    window = _show(shown_page, "TRIP", size, "#alerts")
    button = window.locator("#alert-rows button")
    expect(button).to_be_in_viewport(ratio=1)
    cells = [f"#alert-rows td.{name}" for name in ("from", "to", "what", "largest", "limit")]
    apart = "cells at the side of the button"  # rows of the state before it may be there still
    wait_until(lambda: not any(_overlap(window, "#alert-rows .by", cell) for cell in cells), apart)
    window.evaluate(LONGEST_ROW)
    found = [cell for cell in cells if _overlap(window, "#alert-rows .by", cell)], window.evaluate("layout.cut()")
    window.evaluate("document.querySelector('#alert-rows td.by').dataset.shown = ''")  # it is filled anew
    assert found == ([], [])
    assert _height(window, "header") + _height(window, ".status") < 0.4 * size[1]
    assert _height(window, ".status") - _height(window, "#sentence") < 0.2 * size[1]


def test_aligning_fits_the_panel(shown_page: ShownPage) -> None:
    window = _show(shown_page, "OK", PANEL, "#align")
    expect(window.locator("#align")).to_be_visible()
    expect(window.locator("#align-pitch")).to_have_text(re.compile(r"\d"))
    assert window.evaluate("layout.cut()") == []


@in_english
def test_the_labels_of_the_trend_lie_on_no_value(shown_page: ShownPage) -> None:
    window = _show(shown_page, "OK")
    for name in ("warn", "trip"):
        expect(window.locator(f"#trend-labels .{name}")).to_be_visible()
        assert not _overlap(window, "#trend", f"#trend-labels .{name}")
    assert not _overlap(window, "#trend-labels .warn", "#trend-labels .trip")


@in_english
def test_no_text_of_the_panel_is_smaller_than_16_px(shown_page: ShownPage) -> None:
    for screen in ("", "#alerts", "#service"):
        window = _show(shown_page, "TRIP", PANEL, screen)
        window.wait_for_timeout(250)
        assert window.evaluate("(px) => layout.small(px)", SMALLEST_TEXT_PX) == []


@in_english
def test_nothing_moves_when_the_state_changes(shown_page: ShownPage) -> None:
    window, gateway = _show(shown_page, "OK"), shown_page.gateway
    expect(window.locator("#word")).to_have_text("OK")
    expect(window.locator("#phi")).to_be_visible()
    before = window.evaluate("layout.boxes()")
    for change, word in ((_trip_by_wind_uncalibrated, "LIMIT"), (_unknown, "LIMIT")):
        change(gateway.scene)
        expect(window.locator("#word")).to_have_text(word)
        window.wait_for_timeout(300)
        assert window.evaluate("layout.boxes()") == before


@in_english
@pytest.mark.parametrize("state", ["OK", "TRIP", "SUSPENDED"])
def test_axe_finds_nothing_on_any_screen(shown_page: ShownPage, state: str) -> None:
    for screen in ("", "#alerts", "#service", "#align"):
        window = _show(shown_page, state, DESKTOP, screen)
        window.wait_for_timeout(250)
        found = Axe().run(window)
        assert found.violations_count == 0, found.generate_report()


def test_every_language_has_the_same_texts() -> None:
    english = read_texts("en")
    for table in map(read_texts, LANGUAGES):
        assert set(table) == set(english)
        for key, text in table.items():
            assert sorted(re.findall(r"\{\w+\}", text)) == sorted(re.findall(r"\{\w+\}", english[key])), key
