"""Loss of view in a browser: late data, a gateway or server that is gone, and the tones that go on."""

import re

import pytest
from playwright.sync_api import Browser, expect

from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.gateway.page.screen import Screen
from tests.page_sound import LIMIT_HZ, LOST_HZ, NOTE_TONES, turn_sound_on, wait_for_tone

pytestmark = pytest.mark.slow


FIRST_LATE = """() => import('/link.js').then(async ({Link}) => {
  window.EventSource = class { addEventListener() {} close() {} };
  const link = new Link(() => {}, () => {});
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const take = (now_s) => { link.receive({now_s, page: {stale_s: 1.0}}); return [link.complaint(), link.ageS()]; };
  await wait(1600);
  const first = take(100); // made when it was asked for, or later
  link.source.onerror();
  link.source.onopen();
  await wait(100);
  const next = take(101.6);
  await wait(1500);
  link.source.onerror();
  link.source.onopen();
  const restarted = take(5); // a host that has started again has another clock
  return [first, next, restarted];
})"""


def test_the_first_push_already_shows_how_late_it_is(idle_page: PageUnderTest, browser: Browser) -> None:
    """The age of data is at most the time since they were asked for; a new connection does not make them young again."""
    (first, first_s), (next_, next_s), (restarted, restarted_s) = Screen(browser, idle_page.url).page.evaluate(
        FIRST_LATE
    )
    assert first == {"key": "page_slow", "seconds": "2"}
    assert 1.5 < first_s < 3.0
    assert next_ is None
    assert next_s < 1.0
    assert restarted is None
    assert restarted_s < 1.0


LATE = """() => import('/link.js').then(async ({Link}) => {
  window.EventSource = class { addEventListener() {} close() {} };
  const link = new Link(() => {}, () => {});
  const complaints = [];
  for (const [waitMs, now_s] of [[0, 100.0], [100, 100.1], [2000, 100.2]]) {
    await new Promise((done) => setTimeout(done, waitMs));
    link.receive({now_s, page: {stale_s: 1.0}});
    complaints.push(link.complaint());
  }
  link.source.onerror();
  return [...complaints, link.complaint()];
})"""


def test_late_pushes_are_stale(idle_page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, idle_page.url)
    complaints = screen.page.evaluate(LATE)
    assert complaints == [
        None,
        None,
        {"key": "page_slow", "seconds": "2"},
        {"key": "page_gone"},
    ]


def test_losing_the_gateway_ends_no_tone_and_is_an_alarm_itself(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    screen.shows("LIMIT", "octagon")
    turn_sound_on(screen.page)
    wait_for_tone(screen.page, LIMIT_HZ)
    gateway.speaking.clear()
    screen.shows("STALE", "hourglass")
    wait_for_tone(screen.page, LIMIT_HZ)
    expect(screen.page.locator("#sentence")).to_have_text(
        re.compile(r"^Stop the hoist, end the move gently\. (No new data|Gateway off)")
    )
    expect(screen.page.locator("#interval")).to_have_text(re.compile(r"^not known; was 1\.1° \d"))  # no expected peak

    gateway.scene.level = "normal"
    gateway.speaking.set()
    screen.shows("OK", "circle")
    page.process.kill()
    screen.shows("STALE", "hourglass")
    expect(screen.page.locator("#sentence")).to_have_text("No connection: this display does not watch the swing.")
    wait_for_tone(screen.page, LOST_HZ)
    screen.page.locator("#sound").click()
    expect(screen.page.locator("#sound")).to_have_attribute("data-state", "on")  # silenced by a person


def test_an_angle_that_is_not_known_any_more_sounds(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    turn_sound_on(screen.page)
    gateway.scene.motion_codes = ["too_short"]
    gateway.scene.swinging = gateway.scene.coverage95_deg = None
    screen.shows("NOT KNOWN", "question")
    wait_for_tone(screen.page, LOST_HZ)


def test_a_disturbance_that_lasts_sounds_as_loss_of_view(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    turn_sound_on(screen.page)
    gateway.scene.condition, gateway.scene.trusted = "disturbed", False
    screen.shows("DISTURBED", "zigzag")
    wait_for_tone(screen.page, LOST_HZ)


def test_a_restart_of_the_gateway_does_not_end_the_tone_before_the_angle_is_known(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    screen.shows("LIMIT", "octagon")
    turn_sound_on(screen.page)
    page.process.kill()
    screen.shows("STALE", "hourglass")
    gateway.scene.level = "unknown"
    gateway.scene.motion_codes = ["too_short"]
    gateway.scene.swinging = gateway.scene.coverage95_deg = None
    page.start_again()
    screen.shows("NOT KNOWN", "question")
    wait_for_tone(screen.page, LOST_HZ)
    screen.page.locator("#sound").click()
    expect(screen.page.locator("#sound")).to_have_attribute("data-state", "on")  # a person has heard it
    gateway.scene.level, gateway.scene.swinging, gateway.scene.coverage95_deg = "normal", True, [2.1, 2.5]
    screen.shows("OK", "circle")
    expect(screen.page.locator("#sound")).to_have_attribute("data-state", "on")


def test_a_gateway_that_has_just_started_is_no_loss(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.swinging = gateway.scene.coverage95_deg = None
    screen = Screen(browser, page.url)
    screen.shows("NOT KNOWN", "question")
    turn_sound_on(screen.page)
    screen.page.wait_for_timeout(3000)
    expect(screen.page.locator("#sound")).to_have_attribute("data-state", "on")


@pytest.mark.parametrize("touched", ["#to-alerts", "#acknowledge", "#title"])
def test_the_first_touch_turns_the_sound_on_wherever_it_is(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser, touched: str
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    screen.text("#sound-word", "no sound")
    screen.page.evaluate(NOTE_TONES)
    screen.page.locator(touched).click()
    wait_for_tone(screen.page, LIMIT_HZ)
    screen.text("#sound-word", "Silence")


def test_the_button_says_in_words_what_it_does_and_that_a_tone_was_silenced(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    turn_sound_on(screen.page)
    screen.text("#sound-word", "Silence")
    screen.page.locator("#sound").click()
    screen.text("#sound-word", "silenced")
    expect(screen.page.locator("#sound use")).to_have_attribute("href", "#sound-off")


def test_the_loudspeaker_has_waves_only_while_it_sounds(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    turn_sound_on(screen.page)
    shown = screen.page.locator("#sound use")
    expect(shown).to_have_attribute("href", "#sound-sounding")
    gateway.scene.acknowledged_by = "Ann"
    expect(shown).to_have_attribute("href", "#sound-on")
    gateway.scene.level = "normal"
    screen.text("#sound-word", "")


def test_the_tone_can_be_silenced_while_the_dialog_is_open(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
    screen.page.locator("#acknowledge").click()
    button = screen.page.locator("#sign-in-sound")
    expect(button).to_be_in_viewport(ratio=1)
    expect(button).to_have_text("Silence")
    button.click()
    expect(button).to_have_text("silenced")
    expect(screen.page.locator("#sound")).to_have_attribute("data-state", "on")
    expect(screen.page.locator("#sign-in")).to_be_visible()


def test_the_page_shows_the_loss_and_return_of_its_server(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    page.process.send_signal(19)  # SIGSTOP: connected and silent, as a host that hangs
    screen.shows("STALE", "hourglass")
    page.process.send_signal(18)  # SIGCONT
    screen.shows("OK", "circle")
    page.process.kill()
    screen.shows("STALE", "hourglass")
    screen.text("#phi", "—")
    page.start_again()
    screen.shows("OK", "circle")
    assert gateway.speaking.is_set()
