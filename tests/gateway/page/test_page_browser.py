"""The page in a browser: only what is right is calm, and everybody reaches everything."""

import pytest
from playwright.sync_api import Browser, expect

from gateway.languages import read_texts
from tests.gateway.page.conftest import FakeGateway, PageUnderTest, ShownPage
from tests.gateway.page.screen import CALM, DESKTOP, RED

pytestmark = pytest.mark.slow


def test_only_a_correct_state_is_calm(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.page.set_viewport_size({"width": DESKTOP[0], "height": DESKTOP[1]})
    screen.shows("OK", "circle")
    gateway.scene.calibration = "uncalibrated"
    screen.shows("UNCALIBRATED", "slash")
    expect(screen.band).not_to_have_css("background-color", CALM)
    expect(screen.page.locator("#fact-pivot dd")).to_have_text("0.00 m/s², 0.00 m/s")
    expect(screen.page.locator("#swing-screen")).not_to_contain_text("m/s")
    screen.text("#sentence", "The sensor has no calibration. The angle can be wrong by several degrees.")
    screen.text("#reasons li >> nth=0", "The sensor has no calibration. The angle can be wrong by several degrees.")

    gateway.scene.level, gateway.scene.alert_text = "trip", "swing trip: up to 6.4 deg now"
    screen.shows("LIMIT", "octagon")
    expect(screen.band).to_have_css("background-color", RED)
    screen.text("#also", "also: UNCALIBRATED")
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 6.1, 0.15
    screen.text("#phi", "6.1°")
    screen.text("#sentence", "Stop the hoist, end the move gently. Limit 6.0° exceeded.")
    gateway.scene.phi_max_deg, gateway.scene.ends_in_s = 2.0, 2.95
    screen.text("#phi", "2.0°")
    screen.text("#sentence", "Limit 6.0° was exceeded. Becomes a warning in 3\u00a0s.")

    gateway.speaking.clear()
    screen.shows("STALE", "hourglass")
    expect(screen.band).not_to_have_css("background-color", CALM)
    screen.text("#phi", "—")
    screen.text("#also", "last: LIMIT, UNCALIBRATED")

    gateway.speaking.set()
    gateway.scene.level, gateway.scene.calibration = "normal", "calibrated"
    gateway.scene.condition, gateway.scene.trusted = "disturbed", False
    screen.shows("DISTURBED", "zigzag")
    screen.text("#fact-condition dd", "disturbed, not trusted")
    assert screen.errors == []


HOSTILE = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>"


def test_field_values_are_not_interpreted_as_markup(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    gateway.scene.level = "warn"
    gateway.scene.alert_text = gateway.scene.recording_error = gateway.scene.device_kind = HOSTILE
    gateway.scene.reasons, gateway.scene.trusted = [HOSTILE + "!"], False
    screen.shows("WARNING", "triangle")
    expect(screen.page.locator("#reasons li").first).to_contain_text("<img src=x")
    expect(screen.page.locator("#fact-recording dd")).to_contain_text("<img src=x")
    expect(screen.page).to_have_title("WARNING · Crane 3")
    expect(screen.page.locator("img, script:not([src])")).to_have_count(0)
    assert screen.errors == []


def test_the_operator_is_told_only_of_faults_that_ask_for_action(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.shows("OK", "circle")
    gateway.scene.standing_faults = {"bus": "bus: nobody answers there"}
    expect(screen.page.locator("#to-service")).to_have_class("faulty")
    screen.text("#service-faults", ", faults: 1")
    screen.text("#note", "")
    screen.text("#reasons li >> nth=0", "Does not work: network. bus: nobody answers there")
    gateway.scene.standing_faults = {"recording": "no space left"}
    gateway.scene.recording_error = "no space left"
    screen.text("#note", "Not recording. Tell the service engineer.")
    screen.text("#reasons li >> nth=0", "Not recording. no space left")
    gateway.scene.battery_low = True
    screen.text("#note", "The sensor's battery is low. Charge or change it.")
    gateway.scene.standing_faults, gateway.scene.recording_error, gateway.scene.battery_low = {}, None, None
    gateway.scene.changed_limits = ["alerts.trip_deg is 15, changed over the bus; at commissioning it was 6"]
    screen.text("#note", "The limits of the alarms are not those of commissioning.")
    expect(screen.page.locator("#reasons li >> nth=0")).to_contain_text(gateway.scene.changed_limits[0])
    gateway.scene.changed_limits = []
    screen.text("#note", "")
    expect(screen.page.locator("#to-service")).not_to_have_class("faulty")
    assert screen.errors == []


def test_what_asks_for_no_action_is_announced_rarely(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.shows("OK", "circle")
    screen.page.evaluate(
        """() => {
          window.spoken = [];
          const spoken = document.getElementById('announcement');
          new MutationObserver(() => window.spoken.push(spoken.textContent)).observe(spoken, {childList: true});
        }"""
    )
    for _ in range(3):
        gateway.scene.condition, gateway.scene.trusted = "disturbed", False
        screen.shows("DISTURBED", "zigzag")
        gateway.scene.condition, gateway.scene.trusted = "swinging", True
        screen.shows("OK", "circle")
    gateway.scene.level = "trip"
    screen.shows("LIMIT", "octagon")
    spoken = screen.page.evaluate("window.spoken")
    assert len(spoken) <= 3
    assert spoken[-1].startswith("LIMIT. ")
    assert screen.page.locator("[aria-live=assertive]").count() == 0


def test_the_keyboard_alone_reaches_everything(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.page.reload()  # so that nothing has the focus
    gateway.scene.level = "trip"
    expect(screen.page.locator("#acknowledge")).to_be_visible()
    reached = []
    for _ in range(6):
        screen.page.keyboard.press("Tab")
        reached.append(screen.page.evaluate("document.activeElement.id"))
    assert reached[:5] == ["to-swing", "to-alerts", "to-service", "acknowledge", "sound"]
    screen.page.locator("#acknowledge").focus()
    screen.page.keyboard.press("Enter")
    expect(screen.page.locator("#sign-in")).to_be_visible()
    screen.page.keyboard.press("Escape")
    expect(screen.page.locator("#sign-in")).to_be_hidden()
    expect(screen.page.locator("#acknowledge")).to_be_focused()
    screen.page.locator("#to-alerts").focus()
    screen.page.keyboard.press("Enter")
    expect(screen.page.locator("#alerts-screen")).to_be_visible()


@pytest.mark.parametrize(("query", "language"), [("?lang=de", "de"), ("?lang=xx", "en"), ("", "en")])
def test_the_address_of_a_screen_names_its_language(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser, query: str, language: str
) -> None:
    window = browser.new_page()
    window.goto(f"{page.url}/{query}#alerts")
    expect(window.locator("html")).to_have_attribute("lang", language)
    expect(window.locator("#to-alerts")).to_contain_text(read_texts(language)["alerts"])
    expect(window.locator("#word")).to_have_text("OK")
    expect(window.locator("html")).to_have_attribute("lang", language)  # also once the gateway has said its own
    window.close()
