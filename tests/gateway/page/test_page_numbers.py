"""The angle that decides, as the page shows it in a browser: number, interval, gauge, view from above, trend."""

import re
from itertools import pairwise

import pytest
from playwright.sync_api import Browser, expect

from gateway.messages import Level
from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.units import degrees
from tests.gateway.page.conftest import FakeGateway, PageUnderTest, ShownPage
from tests.gateway.page.screen import CALM, Screen
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


def test_the_angle_is_updated(gateway: FakeGateway, page: PageUnderTest, browser: Browser) -> None:
    screen = Screen(browser, page.url)
    screen.shows("OK", "circle")
    expect(screen.band).to_have_css("background-color", CALM)
    screen.text("#phi", "2.3°")
    screen.text("#present", "1.1°")
    expect(screen.page.locator("#interval")).to_have_text(re.compile(r"^± 0\.2°\s+expected in 1\.\d s$"))
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 3.44, 0.04
    screen.text("#phi", "3.4°")
    gateway.scene.time_to_peak_s = 0.0  # the peak is now
    gateway.scene.angle_share = 1.0
    screen.text("#present", "3.4°")
    screen.text("#interval", "± 0.2°")
    expect(screen.page.locator("#bullseye")).to_have_attribute("aria-label", re.compile(r"swing 3.4° along \+x / \+y"))
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "3.4°, warning 4°, limit 6°")
    expect(screen.page.locator("#trend .line:not(.doubtful)")).to_have_count(1)

    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 0.1, 0.08
    gateway.scene.state, gateway.scene.lean_deg = "rest", 0.0
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
    ("number.js", "degrees", -0.04, "0.0°"),
    ("number.js", "degrees", -0.06, "-0.1°"),
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


def test_numbers_are_rounded_outwards(shown_page: ShownPage) -> None:
    screen = shown_page.screen
    for module, function, argument, expected in CALLS:
        call = f"argument => import('/{module}').then(module => module.{function}(argument, {DIRECTIONS}))"
        got = screen.page.evaluate(call, argument)
        assert got == (pytest.approx(expected, abs=0.01) if isinstance(expected, float) else expected), (
            function,
            argument,
        )


def test_the_coming_peak_is_the_one_that_alerts_judge(shown_page: ShownPage) -> None:
    screen = shown_page.screen
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
        (0.06, 0.14, 0.14, False),  # they cannot be told apart
        (0.02, 0.20, 0.20, True),
        (1.0, 0.19, 1.0, False),
        (0.06, 0.25, 0.25, True),
        (5.4, 5.5, 5.5, False),  # at the turning point
        (1.0, 5.5, 5.5, True),
    ],
)
def test_a_peak_is_expected_where_it_can_be_told_from_the_present_angle(
    shown_page: ShownPage, present_deg: float, peak_deg: float, angle_deg: float, is_expected: bool
) -> None:
    motion = {
        "angle_deg": present_deg,
        "u_deg": 0.07,
        "predicted_phi_max_deg": peak_deg,
        "predicted_u_deg": 0.07,
        "time_to_peak_s": 1.5,
    }
    shown = shown_page.screen.page.evaluate(DECIDING, motion)
    assert (shown["angleDeg"], shown["inS"] > 0) == (angle_deg, is_expected)


def test_a_number_far_above_the_present_angle_is_never_shown_as_that(shown_page: ShownPage) -> None:
    motion = {
        "angle_deg": 0.2,
        "u_deg": 0.3,
        "predicted_phi_max_deg": 3.4,
        "predicted_u_deg": 1.7,
        "time_to_peak_s": 1.5,
    }
    assert shown_page.screen.page.evaluate(DECIDING, motion)["inS"] == 1.5


RADII = """() => [...document.querySelectorAll('#bullseye .limit, #bullseye circle.swing')]
  .map((each) => [each.classList[0], Number(each.getAttribute('r'))])"""


def test_seen_from_above_the_limits_stay_and_the_angle_is_the_deciding_one(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    gateway.scene.azimuth_deg = None  # so that the swing is a circle
    limits = [["limit", pytest.approx(98 * 4 / 6)], ["limit", 98]]
    for expected_deg, last_deg, radius in ((3.0, 7.3, 49.0), (12.4, 3.0, 98.0), (1.5, 12.4, 24.5)):
        gateway.scene.expected_deg, gateway.scene.phi_max_deg = expected_deg, last_deg
        gateway.scene.coverage95_deg = [last_deg - 0.5, 40.0]
        screen.text("#phi", f"{expected_deg}°")
        assert screen.page.evaluate(RADII) == [*limits, ["swing", pytest.approx(radius)]]
        label = re.compile(rf"swing {re.escape(str(expected_deg))}°")
        expect(screen.page.locator("#bullseye")).to_have_attribute("aria-label", label)
        expect(screen.page.locator("#bullseye .beyond")).to_have_count(int(expected_deg > 6))


MAJOR = """() => import('/bullseye.js').then(({Bullseye}) => {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  const state = {
    page: {warn_deg: 3, trip_deg: 5, directions: {plus_x: '', minus_x: '', plus_y: '', minus_y: ''}},
    topics: {swing: {azimuth_deg: 0, lean_deg: 4, lean_azimuth_deg: 0, minor_phi_max_deg: 0.1}, motion: {}},
    verdict: {sound: true},
  };
  new Bullseye(svg).draw(state, {title: '', angleDeg: 10, halfDeg: 0.3, isBound: false});
  return Number(svg.querySelector('ellipse').getAttribute('rx'));
})"""


def test_a_swing_about_a_lean_is_drawn_as_wide_as_it_is(shown_page: ShownPage) -> None:
    """It reaches 10 degrees on one side of a lean of 4, and 2 on the other; the limit of 5 is at 98."""
    assert shown_page.screen.page.evaluate(MAJOR) == pytest.approx(98 * 6 / 5, rel=0.01)


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


def test_one_wide_interval_does_not_change_the_scale_of_the_trend(shown_page: ShownPage) -> None:
    heights = shown_page.screen.page.evaluate(TREND)
    assert len(set(heights)) == 1
    assert 60 <= heights[0] <= 80


SHARES = """(angles) => import('/scale.js').then(({scaleShare}) => angles.map((angle) => scaleShare(angle, 6)))"""


def test_angles_beyond_the_limit_are_told_apart_and_none_is_beyond_the_end(shown_page: ShownPage) -> None:
    shares = shown_page.screen.page.evaluate(SHARES, [0.0, 3.0, 6.0, 9.0, 12.0, 90.0])
    assert shares[:3] == pytest.approx([0, 1 / 3, 2 / 3])
    assert all(after - before > 0.05 for before, after in pairwise(shares))
    assert shares[-1] < 1


LISTED = """([alert, gone]) => import('/alerts.js').then(({AlertList}) => {
  const list = new AlertList(document.createElement('tbody'), {list: () => {}, inNameOf: () => 'Acknowledge'});
  const known = {incident: 'b-1', rule: 'swing', level: 'trip', since_ns: 0, until_ns: 1e9, acknowledged_by: null, limit_deg: 6};
  list.show({since_ns: 0, alerts: [{...known, ...alert}]}, gone);
  return [...list.body.rows[0].cells].slice(1).map((cell) => cell.textContent);
})"""


def test_the_list_tells_which_limit_was_reached_and_nothing_that_nobody_knows(shown_page: ShownPage) -> None:
    def listed(alert: dict[str, object], *, gone: bool = False) -> list[str]:
        cells: list[str] = shown_page.screen.page.evaluate(LISTED, [alert, gone])
        return cells

    assert listed({"largest_deg": 6.5})[2:4] == ["6.5°", "6.0°"]
    assert listed({"largest_deg": 5.1})[2:4] == ["5.1°", "6.0°, expected"]
    assert listed({"largest_deg": 5.1, "is_corrected": True})[2:4] == ["5.1°", "6.0°, not reached"]
    assert listed({"largest_deg": 5.1, "is_cut": True})[2:4] == ["not known", "6.0°"]
    assert listed({"largest_deg": 6.5, "until_ns": None})[::4] == ["now", "Acknowledge"]
    assert listed({"largest_deg": 6.5, "until_ns": None}, gone=True)[::4] == ["not known", "not acknowledged"]


BEGIN = """([oldestS]) => import('/trend.js').then(({Trend}) => {
  const labels = document.createElement('div');
  const trend = new Trend(document.createElementNS('http://www.w3.org/2000/svg', 'svg'), labels, document.createElement('div'));
  trend.add([[0, oldestS, 2, 1, 3, true], [1, 0, 2, 1, 3, true]]);
  trend.draw({warn_deg: 4, trip_deg: 6}, Date.UTC(2026, 0, 1, 12, 30) * 1e6, []);
  return labels.querySelector('.begin').textContent;
})"""


def test_a_curve_shorter_than_its_ten_minutes_says_since_when_it_is_there(shown_page: ShownPage) -> None:
    window = shown_page.screen.page
    assert re.fullmatch(r"curve since \d\d:27", window.evaluate(BEGIN, [150.0]))
    assert window.evaluate(BEGIN, [590.0]) == ""


BAND = "document.querySelector('#gauge .band').style.width"


def test_no_interval_stands_beside_a_doubt(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
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
        expect(screen.page.locator("#interval")).to_have_text(re.compile(r"^not known; was 1\.1° "))
    gateway.scene.condition = "disturbed"
    screen.text("#also", "also: DISTURBED")
    screen.text("#phi", "—")
    assert screen.errors == []


def test_no_swing_is_said_of_a_load_at_rest_alone(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = 0.3, 0.3
    screen.text("#phi", "0.3°")
    screen.text("#interval", "± 0.6°")
    screen.text("#sentence", "Load swings.")
    gateway.scene.state = "rest"
    screen.text("#interval", "no swing detected")
    screen.text("#phi", "0.9°")
    screen.text("#sentence", "Load at rest.")
    gateway.scene.level = "warn"
    screen.text("#phi", "0.3°")
    gateway.scene.level, gateway.scene.phi_max_deg, gateway.scene.phi_max_u_deg = "normal", 0.9, 0.1
    screen.text("#sentence", "Load at rest.")
    screen.text("#interval", "± 0.2°")
    gateway.scene.phi_max_deg = 2.3
    screen.text("#sentence", "Load swings.")


def test_a_lean_alarm_shows_the_lean(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    screen.text("#angle-title", "swing: now, or the larger coming peak")
    gateway.scene.level, gateway.scene.rule = "trip", "lean"
    screen.text("#angle-title", "lean of the rope")
    screen.text("#phi", "6.2°")
    screen.text("#interval", "")
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "6.2°, limit 6°")
    screen.text("#sentence", "Stop the hoist, end the move gently. The rope leans too far. Limit 6.0°.")
    gateway.scene.level = "normal"
    screen.text("#angle-title", "swing: now, or the larger coming peak")
    expect(screen.page.locator("#gauge")).to_have_attribute("aria-label", "2.3°, warning 4°, limit 6°")
    assert screen.errors == []


def test_the_list_has_the_largest_angle_of_an_alarm(shown_page: ShownPage) -> None:
    gateway, screen = shown_page
    gateway.scene.level, gateway.scene.largest_deg, gateway.scene.ends_in_s = "trip", 7.92, 2.5
    screen.page.evaluate("location.hash = '#alerts'")
    screen.text("#sentence", "Limit 6.0° was exceeded. Becomes a warning in 3\u00a0s.")
    screen.text("#alert-rows tr.standing td >> nth=3", "7.9°")
    beside = "() => getComputedStyle(document.getElementById('word'), '::after').content"
    assert "2.3°" in screen.page.evaluate(beside)  # the number that decides is in sight on every screen
    screen.page.evaluate("location.hash = ''")
    wait_until(lambda: screen.page.evaluate(beside) == "none", "no number beside the word")
