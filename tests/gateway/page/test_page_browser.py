"""The page in a browser: what an operator sees in each state."""

import re
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from gateway.messages import Level
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.units import degrees
from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.page_sound import LIMIT_HZ, LOST_HZ, NOTE_TONES, turn_sound_on, wait_for_tone

pytestmark = pytest.mark.slow

PATIENCE_MS = 15_000
CALM, RED = "rgb(211, 214, 217)", "rgb(193, 18, 31)"
PANEL, DESKTOP, PHONE = (800, 480), (1280, 800), (390, 844)
HOSTILE = "<img src=x onerror=\"document.title='owned'\"><script>document.title='owned'</script>"


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

    def right_edge(self, selector: str) -> float:
        box = self.page.locator(selector).bounding_box()
        assert box is not None
        return box["x"] + box["width"]

    def overflow(self) -> tuple[int, int]:
        """Pixels beyond the window, to the right and below."""
        root = "document.documentElement"
        across = self.page.evaluate(f"{root}.scrollWidth - {root}.clientWidth")
        down = self.page.evaluate(f"{root}.scrollHeight - {root}.clientHeight")
        return int(across), int(down)


def test_the_angle_is_updated(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    expect(screen.band).to_have_css("background-color", CALM)
    screen.text("#phi", "2.3°")
    screen.text("#present", "1.1°")
    expect(screen.page.locator("#interval")).to_have_text(re.compile(r"^± 0\.2° \(95 %\)\s+expected in 1\.\d s$"))
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 3.44, 0.04
    screen.text("#phi", "3.4°")
    gateway.scene.time_to_peak_s = 0.0  # the peak is now
    gateway.scene.angle_share = 1.0
    screen.text("#present", "3.4°")
    screen.text("#interval", "± 0.2° (95 %)")
    expect(screen.page.locator("#bullseye")).to_have_attribute("aria-label", re.compile(r"swing 3.4° along \+x / \+y"))
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "3.4°, warning 4°, limit 6°")
    expect(screen.page.locator("#trend .line:not(.doubtful)")).to_have_count(1)

    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 0.1, 0.08
    screen.text("#bound", "≤ ")
    screen.text("#phi", "0.3°")  # a bound is rounded up
    gateway.scene.motion_codes = ["too_short"]
    gateway.scene.swinging = gateway.scene.coverage95_deg = None
    screen.text("#phi", "—")
    screen.shows("NOT KNOWN", "question")
    screen.text("#sentence", "Not enough of a swing seen yet. Usually back within 7 s.")
    assert screen.errors == []
    assert all(url.startswith(page.url) for url in screen.requested)


DIRECTIONS = '{plus_x: "out", minus_x: "in", plus_y: "left", minus_y: "right"}'
CALLS = [
    # The farthest point of the ellipse about the lean is at phi_max from the vertical.
    ("bullseye.js", "semiMajorDeg", {"phi_max_deg": 5, "azimuth_deg": 30, "lean_deg": 0}, 5.0),
    ("bullseye.js", "semiMajorDeg", {"phi_max_deg": 5, "azimuth_deg": 30, "lean_deg": 2, "lean_azimuth_deg": 30}, 3.0),
    ("bullseye.js", "semiMajorDeg", {"phi_max_deg": 5, "azimuth_deg": 30, "lean_deg": 3, "lean_azimuth_deg": 120}, 4.0),
    ("bullseye.js", "semiMajorDeg", {"phi_max_deg": 5, "azimuth_deg": 0, "lean_deg": 2, "lean_azimuth_deg": 180}, 3.0),
    ("number.js", "degrees", 4.25001, "4.3°"),
    ("number.js", "degrees", None, "—"),
    ("number.js", "upwards", 4.21, "4.3°"),
    ("number.js", "upwards", 4.2, "4.2°"),
    ("number.js", "upwards", 0.004, "0.1°"),
    ("number.js", "count", 1234567, "1\u202f234\u202f567"),
    ("number.js", "ago", 1.9, "now"),
    ("number.js", "ago", 59.9, "59 s ago"),
    ("number.js", "ago", 7300, "2 h ago"),
    ("number.js", "ago", None, "—"),
    ("number.js", "directionWords", 10, "out"),
    ("number.js", "directionWords", -40, "right / out"),
    ("number.js", "directionWords", 100, "left"),
    ("number.js", "directionWords", 359, "out"),
    ("number.js", "directionWords", None, ""),
    ("number.js", "nearestDirection", 50, "left"),
    ("number.js", "nearestDirection", -40, "out"),
    ("number.js", "nearestDirection", None, ""),
]


def test_numbers_are_rounded_outwards(page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    for module, function, argument, expected in CALLS:
        call = f"argument => import('/{module}').then(module => module.{function}(argument, {DIRECTIONS}))"
        got = screen.page.evaluate(call, argument)
        assert got == (pytest.approx(expected, abs=0.01) if isinstance(expected, float) else expected), (
            function,
            argument,
        )


def test_the_coming_peak_is_the_one_that_alerts_judge(page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    kept, coasting = (
        PeakEstimate(angle_rad=0.10, u_rad=0.02, in_s=1.5),
        PeakEstimate(angle_rad=0.04, u_rad=0.01, in_s=1.0),
    )
    for first, second in ((kept, coasting), (coasting, kept), (kept, None), (None, coasting), (None, None)):
        judged = MotionEstimate(time_s=0.0, state="driven", next_peak=first, next_peak_if_coasting=second).expected_peak
        motion = {
            "predicted_phi_max_deg": first and degrees(first.angle_rad),
            "predicted_u_deg": first and degrees(first.u_rad),
            "time_to_peak_s": first and first.in_s,
            "coasting_phi_max_deg": second and degrees(second.angle_rad),
            "coasting_u_deg": second and degrees(second.u_rad),
            "coasting_time_to_peak_s": second and second.in_s,
        }
        shown = screen.page.evaluate("motion => import('/peak.js').then(each => each.comingPeak(motion))", motion)
        expected = judged and {
            "angleDeg": pytest.approx(degrees(judged.angle_rad)),
            "uDeg": pytest.approx(degrees(judged.u_rad)),
            "inS": judged.in_s,
        }
        assert shown == expected


DECIDING = "motion => import('/peak.js').then(each => each.deciding(motion))"


@pytest.mark.parametrize(
    ("present_deg", "peak_deg", "angle_deg", "is_expected"),
    [
        (0.06, 0.14, 0.14, False),  # at rest: a peak of the noise
        (0.02, 0.20, 0.20, False),
        (1.0, 0.19, 1.0, False),
        (0.06, 0.25, 0.25, True),
        (5.4, 5.5, 5.5, False),  # at the turning point
        (1.0, 5.5, 5.5, True),
    ],
)
def test_a_peak_is_expected_only_where_it_is_more_than_noise(
    page: PageUnderTest, browser: Browser, present_deg: float, peak_deg: float, angle_deg: float, is_expected: bool
) -> None:
    motion = {
        "angle_deg": present_deg,
        "u_deg": 0.07,
        "predicted_phi_max_deg": peak_deg,
        "predicted_u_deg": 0.07,
        "time_to_peak_s": 1.5,
    }
    shown = Screen(browser, page.url).page.evaluate(DECIDING, motion)
    assert (shown["angleDeg"], shown["inS"] > 0) == (angle_deg, is_expected)


RADII = """() => [...document.querySelectorAll('#bullseye .limit, #bullseye circle.swing')]
  .map((each) => [each.classList[0], Number(each.getAttribute('r'))])"""


def test_seen_from_above_the_limits_stay_and_the_angle_is_the_deciding_one(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    gateway.scene.azimuth_deg = None  # so that the swing is a circle
    screen = Screen(browser, page.url)
    limits = [["limit", pytest.approx(98 * 4 / 6)], ["limit", 98]]
    for expected_deg, last_deg, radius in ((3.0, 7.3, 49.0), (12.4, 3.0, 98.0), (1.5, 12.4, 24.5)):
        gateway.scene.expected_deg, gateway.scene.phi_max_deg = expected_deg, last_deg
        gateway.scene.coverage95_deg = [last_deg - 0.5, 40.0]
        screen.text("#phi", f"{expected_deg}°")
        assert screen.page.evaluate(RADII) == [*limits, ["swing", pytest.approx(radius)]]
        label = re.compile(rf"swing {re.escape(str(expected_deg))}°")
        expect(screen.page.locator("#bullseye")).to_have_attribute("aria-label", label)
        expect(screen.page.locator("#bullseye .beyond")).to_have_count(int(expected_deg > 6))


TREND = """() => import('/trend.js').then(({Trend}) => {
  const part = (name) => document.createElementNS('http://www.w3.org/2000/svg', name);
  const trend = new Trend(part('svg'), document.createElement('div'), document.createElement('div'));
  const limit = () => Number(trend.svg.querySelector('.limit.trip').getAttribute('d').match(/M0 ([\\d.]+)/)[1]);
  const heights = [];
  for (const high of [3, 60, 3]) {
    trend.add([[heights.length, 1, 2, 1, high, true]]);
    trend.draw({warn_deg: 4, trip_deg: 6}, 1e18, []);
    heights.push(100 - limit());
  }
  return heights;
})"""


def test_one_wide_interval_does_not_change_the_scale_of_the_trend(page: PageUnderTest, browser: Browser) -> None:
    heights = Screen(browser, page.url).page.evaluate(TREND)
    assert len(set(heights)) == 1
    assert 60 <= heights[0] <= 80


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


def test_the_first_push_already_shows_how_late_it_is(page: PageUnderTest, browser: Browser) -> None:
    """The age of data is at most the time since they were asked for; a new connection does not make them young again."""
    (first, first_s), (next_, next_s), (restarted, restarted_s) = Screen(browser, page.url).page.evaluate(FIRST_LATE)
    assert first == {"key": "page_slow", "seconds": "2"}
    assert 1.5 < first_s < 3.0
    assert next_ is None
    assert next_s < 1.0
    assert restarted is None
    assert restarted_s < 1.0


def test_late_pushes_are_stale(page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    complaints = screen.page.evaluate(LATE)
    assert complaints == [
        None,
        None,
        {"key": "page_slow", "seconds": "2"},
        {"key": "page_gone"},
    ]


def test_only_a_correct_state_is_calm(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url, DESKTOP)
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
    screen.text("#sentence", "Swing up to 6.4°; limit 6.0°. Becomes a warning below 5.4°.")
    gateway.scene.phi_max_deg, gateway.scene.ends_in_s = 2.0, 2.6
    screen.text("#phi", "2.0°")
    screen.text("#sentence", "It was 6.3°; limit 6.0°. Becomes a warning in 3 s.")

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


def test_no_interval_stands_beside_a_doubt(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    screen.text("#phi", "2.3°")
    gateway.scene.calibration = "uncalibrated"
    screen.shows("UNCALIBRATED", "slash")
    screen.text("#phi", "2.3°")
    screen.text("#interval", re.compile(r"^expected in 1\.\d s$"))
    assert screen.page.evaluate(BAND) == screen.page.evaluate(BAND.replace("band", "fill"))
    gateway.scene.calibration, gateway.scene.trusted, gateway.scene.condition = "calibrated", False, "unknown"
    shown: list[tuple[Level, str, str]] = [("normal", "NOT KNOWN", "question"), ("trip", "LIMIT", "octagon")]
    for level, word, shape in shown:
        gateway.scene.level = level
        screen.shows(word, shape)
        for number in ("#phi", "#present", "#lean"):
            screen.text(number, "—")
        expect(screen.page.locator("#interval")).to_have_text(re.compile(r"^not known; was 2\.3° "))
    gateway.scene.condition = "disturbed"
    screen.text("#also", "also: DISTURBED")
    screen.text("#phi", "—")
    assert screen.errors == []


BAND = "document.querySelector('#gauge .band').style.width"


def test_no_swing_is_said_of_small_swings_only(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    """A warning ends below 3.0."""
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 1.9, 1.1
    screen = Screen(browser, page.url)
    screen.text("#phi", "1.9°")
    screen.text("#interval", "± 2.2° (95 %)")
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 0.9, 0.9
    screen.text("#interval", "no swing detected")
    screen.text("#phi", "2.7°")
    gateway.scene.level = "warn"
    screen.text("#phi", "0.9°")
    gateway.scene.level, gateway.scene.phi_max_u_deg, gateway.scene.state = "normal", 0.1, "rest"
    screen.text("#phi", "1.1°")
    screen.text("#interval", "no swing detected")


def test_a_lean_alarm_shows_the_lean(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    screen.text("#angle-title", "swing: now, or the larger coming peak")
    gateway.scene.level, gateway.scene.rule = "trip", "lean"
    screen.text("#angle-title", "lean of the rope")
    screen.text("#phi", "6.2°")
    screen.text("#interval", "")
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "6.2°, limit 6°")
    screen.text("#sentence", re.compile("^The rope leans 6.4°; limit 6.0°. Ends below 3.0°.$"))
    gateway.scene.level = "normal"
    screen.text("#angle-title", "swing: now, or the larger coming peak")
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "2.3°, warning 4°, limit 6°")
    assert screen.errors == []


def test_list_and_sentence_state_the_same_angle(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    gateway.scene.level, gateway.scene.largest_deg, gateway.scene.ends_in_s = "trip", 7.92, 2.5
    screen = Screen(browser, page.url + "#alerts")
    screen.text("#sentence", re.compile("^It was 7.9°;"))
    screen.text("#alert-rows td >> nth=3", "7.9°")


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

    gateway.scene.level = "normal"
    gateway.speaking.set()
    screen.shows("OK", "circle")
    page.process.kill()
    screen.shows("STALE", "hourglass")
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
    screen.text("#sound-word", "")


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


def test_field_values_are_not_interpreted_as_markup(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
    gateway.scene.level = "warn"
    gateway.scene.alert_text = gateway.scene.recording_error = gateway.scene.device_kind = HOSTILE
    gateway.scene.reasons, gateway.scene.trusted = [HOSTILE + "!"], False
    screen.shows("WARNING", "triangle")
    expect(screen.page.locator("#reasons li").first).to_contain_text("<img src=x")
    expect(screen.page.locator("#fact-recording dd")).to_contain_text("<img src=x")
    expect(screen.page).to_have_title("WARNING · Crane 3")
    expect(screen.page.locator("img, script:not([src])")).to_have_count(0)
    assert screen.errors == []


def test_the_operator_is_told_only_of_faults_that_ask_for_action(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
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


def test_what_asks_for_no_action_is_announced_rarely(
    gateway: FakeGateway, page: PageUnderTest, browser: Browser
) -> None:
    screen = Screen(browser, page.url)
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


def test_the_keyboard_alone_reaches_everything(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    gateway.scene.level = "trip"
    screen = Screen(browser, page.url)
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
