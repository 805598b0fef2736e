"""The sentence under the word, in a browser: what acts, what was compared, what follows, and what is silent."""

import json
import re
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.gateway.page.conftest import FakeGateway, PageUnderTest, ShownPage
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

YIELDING = """() => import('/steady.js').then(({Steady}) => {
  const steady = new Steady(() => 0);
  return ["rest", "free", "rest"].map((form) => steady.keep("doing", form));
})"""


def test_rest_is_not_held_against_a_number_that_denies_it(shown_page: ShownPage) -> None:
    assert shown_page.screen.page.evaluate(YIELDING) == ["rest", "free", "free"]


SLOW = """() => import('/steady.js').then(({Steady}) => {
  let nowS = 0;
  const steady = new Steady(() => nowS);
  return [[0, "free"], [3, "rest"], [3.3, "free"], [4, "rest"], [5.9, "rest"], [6, "rest"], [6.1, "free"]].map(([atS, form]) => {
    nowS = atS;
    return steady.keep("doing", form);
  });
})"""


def test_the_load_is_said_to_rest_once_it_has_rested_for_two_seconds(shown_page: ShownPage) -> None:
    assert shown_page.screen.page.evaluate(SLOW) == ["free", "free", "free", "free", "free", "rest", "free"]


UNCERTAIN = """() => import('/steady.js').then(({Steady}) => {
  let nowS = 0;
  const steady = new Steady(() => nowS);
  return [[0, "free"], [0.5, "uncertain"], [0.8, "free"], [2.6, "free"]].map(([atS, form]) => {
    nowS = atS;
    return steady.keep("doing", form);
  });
})"""


def test_a_number_is_called_uncertain_at_once_and_long_enough_to_be_read(shown_page: ShownPage) -> None:
    assert shown_page.screen.page.evaluate(UNCERTAIN) == ["free", "uncertain", "uncertain", "free"]


STRONGER = """() => import('/steady.js').then(({Steady}) => {
  let nowS = 0;
  const steady = new Steady(() => nowS);
  const asked = [[0, "alarm_possible"], [0.2, "alarm_coming"], [0.4, "alarm_possible"], [0.6, "alarm_passed"]];
  return asked.map(([atS, form]) => {
    nowS = atS;
    return steady.keep("alarm", form);
  });
})"""


def test_what_is_certain_to_come_is_said_at_once_and_not_taken_back_for_a_doubt(shown_page: ShownPage) -> None:
    said = shown_page.screen.page.evaluate(STRONGER)
    assert said == ["alarm_possible", "alarm_coming", "alarm_coming", "alarm_passed"]


STOP = "Stop the hoist, end the move gently."


def test_a_sentence_keeps_its_form_for_two_seconds(shown_page: ShownPage) -> None:
    assert shown_page.screen.page.evaluate(STEADY) == ["a", "a", "a", "b", "b", "a", "a"]


ALARM = """([active, value]) => import('/sentence.js').then(({sentence}) =>
  sentence({word: active.level === 'trip' ? 'TRIP' : 'WARN'},
           {age_s: {alert: 0.4}, topics: {alert: {active: [active]}}, alert_log: {alerts: [active]}},
           value && {angleDeg: value[0], inS: value[1], halfDeg: value[2]}))"""

SWING = {
    "rule": "swing",
    "level": "trip",
    "value_deg": 6.36,
    "limit_deg": 6.0,
    "largest_deg": 5.2,
    "expected_in_s": 1.8,
}
LARGE = {**SWING, "largest_deg": 7.92}

FALLS = {"next_level": "warn", "next_below_deg": 5.4, "ends_in_s": None}

ENDS = {"next_level": "normal", "next_below_deg": 3.0, "ends_in_s": None}

WARNING = {**SWING, **ENDS, "level": "warn", "value_deg": 4.36, "limit_deg": 4.0, "expected_in_s": 0.0}

LEAN = {**SWING, **ENDS, "rule": "lean", "limit_deg": 3.0, "next_below_deg": 2.4, "expected_in_s": 0.0}

ONLY_A_WARNING = "Only a warning once clearly below 5.4°."
ALARMS = [
    ({**SWING, **FALLS}, (8.1, 1.8, 0.5), f"{STOP} Limit 6.0° about to be exceeded."),
    ({**SWING, **FALLS}, (6.1, 1.8, 2.4), f"{STOP} Limit 6.0° may be exceeded."),
    ({**SWING, **FALLS}, (6.0, 0.0), f"{STOP} Limit 6.0° may be exceeded."),
    ({**SWING, **FALLS}, (5.8, 0.0, 0.3), f"{STOP} Limit 6.0° may be exceeded."),
    ({**SWING, **FALLS}, (5.5, 0.0, 0.3), f"Limit 6.0° may have been exceeded. {ONLY_A_WARNING}"),
    ({**SWING, **FALLS}, (5.8, 0.0), f"{STOP} Limit 6.0° may be exceeded."),
    ({**LARGE, **FALLS}, (4.1, 1.8), f"{STOP} Limit 6.0° exceeded."),
    ({**LARGE, **FALLS}, (4.1, 0.0, 0.3), f"Limit 6.0° was exceeded. {ONLY_A_WARNING}"),
    ({**LARGE, **FALLS, "ends_in_s": 2.5}, (4.1, 0.0), "Limit 6.0° was exceeded. Becomes a warning in 3\u00a0s."),
    ({**LARGE, **ENDS, "ends_in_s": 2.5}, (2.1, 0.0), "Limit 6.0° was exceeded. Ends in 3\u00a0s."),
    ({**SWING, **FALLS, "is_corrected": True}, (5.5, 0.0, 0.3), f"Limit 6.0° was not reached. {ONLY_A_WARNING}"),
    (
        {**SWING, **FALLS, "ends_in_s": 0.3},
        (5.1, 0.0),
        "Limit 6.0° may have been exceeded. Becomes a warning in 1\u00a0s.",
    ),
    ({**SWING, **FALLS}, None, f"{STOP} The angle is not known now."),
    (WARNING, (4.4, 0.0), "Move gently. Warning level 4.0° exceeded."),
    (WARNING, (3.4, 0.0, 0.3), "Warning level 4.0° was exceeded. Ends once clearly below 3.0°."),
    ({**LEAN, "value_deg": 4.02}, (4.0, 0.0), f"{STOP} The rope leans too far. Limit 3.0°."),
    ({**LEAN, "ends_in_s": 1.2}, (2.0, 0.0), "The rope leaned too far. Limit 3.0°. Ends in 1\u00a0s."),
]
TWO_ALARMS = """(active) => import('/sentence.js').then(({sentence}) =>
  sentence({word: 'TRIP'}, {age_s: {}, topics: {alert: {active}}}, {angleDeg: 4.1, inS: 0, halfDeg: 0.3}))"""


def test_an_alarm_says_what_its_limit_is_and_what_follows_and_no_second_angle(shown_page: ShownPage) -> None:
    screen = shown_page.screen
    for active, value, expected in ALARMS:
        assert screen.page.evaluate(ALARM, [active, value]) == expected


UNTRUSTED = """(value) => import('/sentence.js').then(({sentence}) =>
  sentence({word: 'TRIP'}, {age_s: {}, topics: {condition: {trusted: false}, alert: {active: [ACTIVE]}}}, value))"""


def test_an_alarm_stays_while_the_readings_cannot_be_trusted(shown_page: ShownPage) -> None:
    screen = shown_page.screen
    program = UNTRUSTED.replace("ACTIVE", json.dumps({**LARGE, **FALLS}))
    told = screen.page.evaluate(program, {"angleDeg": 4.1, "inS": 0, "halfDeg": 0.3})
    assert told == "Limit 6.0° was exceeded. Stays while the readings are in doubt."
    assert screen.page.evaluate(program, None) == f"{STOP} The angle is not known now."


def test_no_end_of_an_alarm_is_told_while_another_of_its_level_stands(shown_page: ShownPage) -> None:
    screen = shown_page.screen
    swing = {**LARGE, **FALLS, "ends_in_s": 1.0}
    told = screen.page.evaluate(TWO_ALARMS, [swing, {**LEAN, "level": "trip"}])
    assert told == "Limit 6.0° was exceeded. The rope also leans too far."
    low = {**LEAN, "level": "trip", "estimate_deg": 1.2}
    assert screen.page.evaluate(TWO_ALARMS, [swing, low]) == "Limit 6.0° was exceeded. Becomes a warning in 1\u00a0s."
    assert (
        screen.page.evaluate(TWO_ALARMS, [swing, WARNING]) == "Limit 6.0° was exceeded. Becomes a warning in 1\u00a0s."
    )


DOING = """(motion) => import('/sentence.js').then(({sentence}) =>
  sentence({word: 'OK'}, {topics: {motion}, age_s: {}}, null))"""


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        (None, ""),
        ({"state": "unknown"}, ""),
        ({"state": "rest", "probabilities": {"free": 1.0}}, "Load at rest."),
        ({"state": "free", "probabilities": {"free": 1.0}}, "Load swings."),
        ({"state": "driven", "probabilities": {"driven": 0.94}}, "Load swings."),
        ({"state": "driven", "probabilities": {"driven": 0.95}}, "Crane speeds up or brakes."),
        ({"state": "driven", "probabilities": None}, "Load swings."),
        ({"state": "wind", "probabilities": {"wind": 0.6}}, "Load swings."),
        ({"state": "wind", "probabilities": {"wind": 0.96}}, "A gust pushes the load."),
        ({"state": "hoisting", "hoist_m_s": 0.4, "probabilities": {"hoisting": 0.7}}, "Load swings."),
        ({"state": "hoisting", "hoist_m_s": 0.4, "probabilities": {"hoisting": 0.97}}, "Lowering."),
        ({"state": "hoisting", "hoist_m_s": -0.4, "probabilities": {"hoisting": 0.97}}, "Hoisting."),
    ],
)
def test_only_a_cause_that_is_all_but_certain_is_named(
    shown_page: ShownPage, motion: dict[str, Any] | None, expected: str
) -> None:
    assert shown_page.screen.page.evaluate(DOING, motion) == expected


def test_a_calm_that_is_not_certain_has_no_tick(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.shows("OK", "circle")
    gateway.scene.phi_max_u_deg = 1.5
    screen.text("#sentence", "Not certain: the swing can be larger.")
    screen.shows("OK", "ring")
    gateway.scene.phi_max_u_deg = 0.1
    screen.shows("OK", "circle")


BESIDE = """(angle) => Promise.all([import('/peak.js'), import('/sentence.js')]).then(([{bigNumber}, {sentence}]) => {
  const motion = {state: 'rest', lean_deg: 0.4, u_deg: 0.1, ...angle};
  const value = bigNumber({sound: true}, {motion}, {warn_deg: 4, trip_deg: 6});
  return [sentence({word: 'OK'}, {topics: {motion}, age_s: {}}, value), value.isBound, value.inS > 0];
})"""


@pytest.mark.parametrize(
    ("angle", "shown"),
    [
        ({"angle_deg": 0.1}, ("Load swings.", False, False)),  # beside its lean
        ({"angle_deg": 0.1, "lean_deg": 0.0}, ("Load at rest.", True, False)),
        ({"angle_deg": 0.5}, ("Load at rest.", False, False)),  # it hangs beside the vertical
        (
            {"angle_deg": 0.5, "predicted_phi_max_deg": 0.55, "predicted_u_deg": 0.1, "time_to_peak_s": 1.0},
            ("Load at rest.", False, False),
        ),
        ({"angle_deg": 1.2}, ("Load swings.", False, False)),  # about to return
        ({"angle_deg": 0.1, "u_deg": 2.9}, ("Not certain: the swing can be larger.", False, False)),
        ({"angle_deg": 1.6, "u_deg": 1.5, "state": "wind"}, ("Not certain: the swing can be larger.", False, False)),
    ],
)
def test_number_and_sentence_say_the_same_of_a_load_at_rest(
    shown_page: ShownPage, angle: dict[str, Any], shown: tuple[str, bool, bool]
) -> None:
    assert tuple(shown_page.screen.page.evaluate(BESIDE, angle)) == shown


SILENCE = """() => import('/sentence.js').then(({sentence}) =>
  sentence({word: 'STALE'}, {gateway: true, topics: {}, age_s: {tilt: 1.3, motion: 1.4, swing: 6.8}}))"""


def test_silence_is_as_old_as_the_newest_sample(shown_page: ShownPage) -> None:
    """A swing is estimated once in seconds: its age says nothing of a gateway that has just fallen silent."""
    screen = shown_page.screen
    screen.shows("OK", "circle")
    assert "1 s" in screen.page.evaluate(SILENCE)


def test_a_silent_sensor_is_told_from_a_gateway_that_is_gone(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.shows("OK", "circle")
    gateway.scene.validity = "no_samples"
    screen.shows("STALE", "hourglass")
    screen.text("#sentence", "No readings come from the sensor.")
    screen.text("#interval", re.compile(r"^not known; was 1\.1° "))
    gateway.speaking.clear()
    screen.text("#sentence", "Gateway off or not connected: nobody watches the swing.")
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
