"""The sentence under the word, in a browser: what acts, what was compared, what follows, and what is silent."""

import re
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.gateway.page.screen import Screen

pytestmark = pytest.mark.slow


STEADY = """() => import('/steady.js').then(({Steady}) => {
  let nowS = 0;
  const steady = new Steady(() => nowS);
  return [[0, "a"], [1, "b"], [1.9, "b"], [2, "b"], [3, "a"], [4.1, "a"], [4.2, "b"]].map(([atS, form]) => {
    nowS = atS;
    return steady.keep("alarm", form);
  });
})"""


def test_a_sentence_keeps_its_form_for_two_seconds(page: PageUnderTest, browser: Browser) -> None:
    assert Screen(browser, page.url).page.evaluate(STEADY) == ["a", "a", "a", "b", "b", "a", "a"]


ALARM = """(active) => import('/sentence.js').then(({sentence}) =>
  sentence({word: active.level === 'trip' ? 'TRIP' : 'WARN'}, {age_s: {alert: 0.4}, topics: {alert: {active: [active]}}}))"""

SWING = {
    "rule": "swing",
    "level": "trip",
    "value_deg": 6.36,
    "limit_deg": 6.0,
    "largest_deg": 5.2,
    "expected_in_s": 1.8,
}

FALLS = {"next_level": "warn", "next_below_deg": 5.4, "ends_in_s": None}

ENDS = {"next_level": "normal", "next_below_deg": 3.0, "ends_in_s": None}

WARNING = {**SWING, **ENDS, "level": "warn", "value_deg": 4.36, "limit_deg": 4.0, "expected_in_s": 0.0}

LEAN = {**SWING, **ENDS, "rule": "lean", "limit_deg": 3.0, "next_below_deg": 2.4, "expected_in_s": 0.0}

ALARMS = [
    ({**SWING, **FALLS}, "Swing up to 6.4° expected; limit 6.0°. Becomes a warning below 5.4°."),
    ({**SWING, **FALLS, "expected_in_s": 0.4}, "Swing up to 6.4°; limit 6.0°. Becomes a warning below 5.4°."),
    (
        {**SWING, **FALLS, "value_deg": 5.1, "largest_deg": 7.92, "ends_in_s": 2.5},
        "It was 7.9°; limit 6.0°. Becomes a warning in 3 s.",
    ),
    (
        {**SWING, **ENDS, "value_deg": 2.1, "largest_deg": 7.92, "ends_in_s": 2.5},
        "It was 7.9°; limit 6.0°. Ends in 3 s.",
    ),
    (
        {**SWING, **FALLS, "value_deg": 5.1, "ends_in_s": 0.3},
        "It was 5.2°, below limit 6.0°. Becomes a warning in 1 s.",
    ),
    (
        {**SWING, **FALLS, "value_deg": None},
        "The angle is not known now, and the alarm stays. Becomes a warning below 5.4°.",
    ),
    (WARNING, "Swing up to 4.4°; warning level 4.0°. Ends below 3.0°."),
    ({**WARNING, "value_deg": 2.0, "ends_in_s": 2.0}, "It was 5.2°; warning level 4.0°. Ends in 2 s."),
    (
        {**WARNING, "value_deg": 2.0, "ends_in_s": 2.0, "largest_deg": 3.96},
        "It was 4.0°; warning level 4.0°. Ends in 2 s.",
    ),
    ({**LEAN, "value_deg": 4.02}, "The rope leans 4.0°; limit 3.0°. Ends below 2.4°."),
    ({**LEAN, "value_deg": 0.4, "largest_deg": 3.98, "ends_in_s": 2.0}, "It was 4.0°; limit 3.0°. Ends in 2 s."),
]


def test_an_alarm_says_what_was_compared_and_what_follows(page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    for active, expected in ALARMS:
        assert screen.page.evaluate(ALARM, active) == expected


DOING = """(motion) => import('/sentence.js').then(({sentence}) =>
  [sentence({word: 'OK'}, {topics: {motion}, age_s: {}}),
   sentence({word: 'WARN'}, {topics: {motion, alert: {active: [{level: 'warn', rule: 'swing'}]}}, age_s: {}})])"""

UNKNOWN_ALARM = "The angle is not known now, and the alarm stays."


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        (None, ""),
        ({"state": "unknown"}, ""),
        ({"state": "rest", "probabilities": {"free": 1.0}}, "Load at rest."),
        ({"state": "free", "probabilities": {"free": 1.0}}, "Load swings."),
        ({"state": "driven", "probabilities": {"driven": 0.94}}, "Load set swinging."),
        ({"state": "driven", "probabilities": {"driven": 0.95}}, "Crane speeds up or brakes."),
        ({"state": "driven", "probabilities": None}, "Load set swinging."),
        ({"state": "wind", "probabilities": {"wind": 0.6}}, "Load set swinging."),
        ({"state": "wind", "probabilities": {"wind": 0.96}}, "A gust pushes the load."),
        ({"state": "hoisting", "hoist_m_s": 0.4, "probabilities": {"hoisting": 0.7}}, "Load swings."),
        ({"state": "hoisting", "hoist_m_s": 0.4, "probabilities": {"hoisting": 0.97}}, "Lowering."),
        ({"state": "hoisting", "hoist_m_s": -0.4, "probabilities": {"hoisting": 0.97}}, "Hoisting."),
    ],
)
def test_only_a_cause_that_is_all_but_certain_is_named(
    page: PageUnderTest, browser: Browser, motion: dict[str, Any] | None, expected: str
) -> None:
    calm, alarm = Screen(browser, page.url).page.evaluate(DOING, motion)
    assert calm == expected
    assert alarm == (UNKNOWN_ALARM if expected.startswith("Load") else f"{expected} {UNKNOWN_ALARM}".strip())


SILENCE = """() => import('/sentence.js').then(({sentence}) =>
  sentence({word: 'STALE'}, {gateway: true, topics: {}, age_s: {tilt: 1.3, motion: 1.4, swing: 6.8}}))"""


def test_silence_is_as_old_as_the_newest_sample(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    """A swing is estimated once in seconds: its age says nothing of a gateway that has just fallen silent."""
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    assert "1 s" in screen.page.evaluate(SILENCE)


def test_a_silent_sensor_is_told_from_a_gateway_that_is_gone(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    gateway.scene.validity = "no_samples"
    screen.shows("STALE", "hourglass")
    screen.text("#sentence", re.compile(r"^No readings come from the sensor. Known last (now|\d+ s ago).$"))
    gateway.speaking.clear()
    screen.text("#sentence", "The gateway has stopped, or it is disconnected.")
    gateway.scene.validity = "valid"
    gateway.speaking.set()
    screen.shows("OK", "circle")


def test_a_sensor_that_never_spoke_is_said_to_be_silent(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.validity = "no_samples"
    screen = Screen(browser, page.url)
    screen.shows("STALE", "hourglass")
    screen.text("#sentence", "No readings come from the sensor.")
