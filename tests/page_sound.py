"""The tones that the page plays, as its browser was asked to play them."""

from playwright.sync_api import Page

from tests.waiting import wait_until

LIMIT_HZ, LOST_HZ = 880, 370
NOTE_TONES = """() => {
  window.tones = [];
  const Real = window.OscillatorNode;
  window.OscillatorNode = class extends Real {
    constructor(context, options) { super(context, options); window.tones.push(options.frequency); }
  };
}"""


def turn_sound_on(page: Page) -> None:
    """Touch the button of the sound, and note each tone from now on."""
    page.evaluate(NOTE_TONES)
    page.locator("#sound").click()


def wait_for_tone(page: Page, frequency_hz: float) -> None:
    """Wait until the page plays a tone again, whatever it has played before."""
    page.evaluate("window.tones = []")
    wait_until(lambda: frequency_hz in page.evaluate("window.tones"), f"a tone of {frequency_hz} Hz")
