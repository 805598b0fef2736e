"""The rigger's screens in a browser: the next face of a recalibration, the advice for the screws, the drift among the facts."""

import re
from dataclasses import replace

import pytest
from playwright.sync_api import Page, expect

from gateway.messages import NO_SESSION, CalibrationOffer, SessionPose
from tests.gateway.page.conftest import FakeGateway, ShownPage

pytestmark = pytest.mark.slow

COLLECTING = replace(
    NO_SESSION,
    id="session-1",
    phase="collecting",
    method="six-position",
    by="ann",
    poses=[SessionPose(face="+x", count=300, used=True), SessionPose(face="-y", count=300, used=True)],
    wanted=6,
    still=True,
    pose_fraction=0.4,
    seconds_left=1.3,
    next_face="-x",
    next_direction=[-1.0, 0.0, 0.0],
    suspended=True,
    text="hold still; next: -x up; missing: -x, +y, +z, -z",
    hints=["pose_hold"],
)
HOSTILE = "<img src=x onerror=document.title='bad'>"
SIZES = [(800, 480), (1280, 800)]


@pytest.fixture
def gateway(shown_page: ShownPage) -> FakeGateway:
    return shown_page.gateway


@pytest.fixture
def screen(shown_page: ShownPage) -> Page:
    return shown_page.screen.page


def test_the_rigger_sees_the_next_attitude(gateway: FakeGateway, screen: Page) -> None:
    expect(screen.locator("#word")).to_have_text("OK")
    expect(screen.locator("#calibration")).to_be_hidden()
    gateway.scene.session = COLLECTING
    expect(screen.locator("#word")).to_have_text("SUSPENDED")
    expect(screen.locator("#shape")).to_have_attribute("href", "#shape-pause")
    expect(screen.locator("#swing-screen")).to_be_hidden()
    expect(screen.locator("#next-face")).to_have_text("-x up")
    expect(screen.locator("#still")).to_have_text("HOLD STILL")
    expect(screen.locator("#seconds-left")).to_have_text("for 2 s")
    expect(screen.locator("#poses-title")).to_have_text("poses taken: 2 of 6")
    expect(screen.locator("#poses li.taken")).to_have_text(["+x", "-y"])
    expect(screen.locator("#poses li.wanted")).to_have_text("-x")
    assert "-x" in screen.locator("#pictogram text").all_text_contents()
    gateway.scene.session = replace(COLLECTING, still=False, seconds_left=None, hints=["pose_moved"])
    expect(screen.locator("#still")).to_have_text("TURN TO -X")
    expect(screen.locator("#session-text")).to_have_text("It moved too early: not taken. Lay it down again.")
    gateway.scene.session = replace(COLLECTING, seconds_left=None, pose_fraction=0.0)  # at rest on a face that is taken
    expect(screen.locator("#still")).to_have_text("TURN TO -X")
    for width, height in SIZES:
        screen.set_viewport_size({"width": width, "height": height})
        root = "document.documentElement"
        assert screen.evaluate(
            f"[{root}.scrollWidth - {root}.clientWidth, {root}.scrollHeight - {root}.clientHeight]"
        ) == [
            0,
            0,
        ]


def test_review_and_end_are_shown_before_the_swing_returns(gateway: FakeGateway, screen: Page) -> None:
    review = replace(
        COLLECTING, phase="review", next_face=None, next_direction=None, text="may not", reasons=[HOSTILE], still=False
    )
    gateway.scene.session = review
    expect(screen.locator("#still")).to_have_text("WAIT")
    expect(screen.locator("#session-text")).to_have_text(re.compile("The service engineer decides.$"))
    expect(screen.locator("#pictogram .box-done")).to_have_count(0)
    gateway.scene.session = replace(review, reasons=[], committable=True)
    expect(screen.locator("#pictogram .box-done")).to_have_count(1)
    gateway.scene.session = replace(review, phase="rejected", text="ended: plumbline remote cancel")
    expect(screen.locator("#still")).to_have_text("ENDED")
    expect(screen.locator("#calibration")).not_to_contain_text("plumbline")  # a rigger has no terminal
    expect(screen.locator("#word")).to_have_text("SUSPENDED")
    gateway.scene.session = replace(review, phase="committed", suspended=False)
    expect(screen.locator("#swing-screen")).to_be_visible()
    expect(screen.locator("#word")).to_have_text("OK")


def test_a_norm_fit_shows_the_most_informative_direction(gateway: FakeGateway, screen: Page) -> None:
    gateway.scene.session = replace(
        COLLECTING, method="norm-fit", wanted=12, next_face=None, next_direction=[0.6, 0.0, 0.8]
    )
    expect(screen.locator("#next-face")).to_have_text("as in the picture")
    expect(screen.locator("#poses-title")).to_have_text(re.compile("2 of 12"))
    gateway.speaking.clear()
    expect(screen.locator("#word")).to_have_text("STALE")
    expect(screen.locator("#session-text")).to_have_text("No contact with the gateway.")


def test_the_box_has_the_requested_attitude(screen: Page) -> None:
    """Rows of the rotation: orthonormal, right-handed, and the wanted direction ends up vertical."""
    for up in ([1, 0, 0], [0, -1, 0], [0, 0, -1], [0.6, 0.0, 0.8], [1, -1, 1]):
        rows = screen.evaluate("up => import('/box.js').then(box => box.rotationToVertical(up))", up)
        length = sum(value * value for value in up) ** 0.5
        assert rows[2] == pytest.approx([value / length for value in up])
        for i in range(3):
            for j in range(3):
                assert sum(a * b for a, b in zip(rows[i], rows[j], strict=True)) == pytest.approx(
                    float(i == j), abs=1e-12
                )
        a, b, c = rows
        cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        assert cross == pytest.approx(c)


def test_the_larger_angle_first_then_the_other_until_both_are_aligned(gateway: FakeGateway, screen: Page) -> None:
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


def test_there_is_no_advice_without_a_reading_at_rest(gateway: FakeGateway, screen: Page) -> None:
    scene = gateway.scene
    screen.locator("#to-service").click()
    screen.locator("#align-link").click()
    expect(screen.locator("#align-word")).to_have_text("WAIT")
    expect(screen.locator("#align-text")).to_have_text("Wait until the load hangs still.")
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


def test_an_unknown_drift_is_never_shown_as_good(gateway: FakeGateway, screen: Page) -> None:
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


def test_an_offered_record_is_named_beside_the_calibration(gateway: FakeGateway, screen: Page) -> None:
    fact = screen.locator("#fact-calibration dd")
    expect(fact).not_to_have_text(re.compile("offered"))
    gateway.scene.offer = CalibrationOffer(record="20261128T100000Z-1", text="thermal-rest")
    expect(fact).to_have_text(re.compile("; offered: 20261128T100000Z-1$"))
