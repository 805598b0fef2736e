"""The verdict by a table: calm only when everything is right, and which word goes before which."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest

from gateway.gateway_state import GatewayPresence, GatewayState
from gateway.messages import NO_SESSION, Alert, Level, Message, Validity
from gateway.page.verdict import STATED_VERDICTS, STYLES, USUAL_INTERVAL_S, PageEvidence, verdict
from gateway.topics import TOPIC_OF, TOPICS
from tests.gateway.scene import Scene
from tests.values import present

Change = Callable[[Any], None]


def evidence_of(scene: Scene, gateway: bool = True, age_s: float = 0.05, **ages_s: float) -> PageEvidence:
    latest = {TOPIC_OF[type(message)].name: message for message in scene.messages(0, 1)}
    return PageEvidence(gateway, latest, dict.fromkeys(latest, age_s) | ages_s, stale_s=1.0)


def setting(**changes: Any) -> Change:
    def change(scene: Scene) -> None:
        for name, value in changes.items():
            assert hasattr(scene, name)
            setattr(scene, name, value)

    return change


NO_SWING = {"swinging": False, "phi_max_deg": None, "coverage95_deg": [0.0, 0.2], "condition": "static"}
SUSPENDED = replace(NO_SESSION, id="session-1", phase="collecting", suspended=True)
DISTURBED = {"condition": "disturbed", "trusted": False}
TABLE = [
    (setting(), {}, "OK"),
    (setting(**NO_SWING), {}, "OK"),
    (setting(calibration="factory"), {}, "OK"),
    (setting(level="warn"), {}, "WARN"),
    (setting(level="trip"), {}, "TRIP"),
    (setting(level="unknown"), {}, "UNKNOWN"),
    (setting(calibration="uncalibrated"), {}, "UNCALIBRATED"),
    (setting(calibration="as_recorded"), {}, "UNCALIBRATED"),
    (setting(condition="driven"), {}, "OK"),
    (setting(**DISTURBED), {}, "DISTURBED"),
    (setting(condition="disturbed"), {}, "DISTURBED"),
    (setting(condition="unknown", trusted=False), {}, "UNKNOWN"),
    (setting(condition="unknown"), {}, "UNKNOWN"),
    (setting(trusted=False), {}, "UNKNOWN"),
    (setting(swinging=None), {}, "UNKNOWN"),
    (setting(phi_max_deg=None), {}, "UNKNOWN"),
    (setting(phi_max_deg=math.nan), {}, "UNKNOWN"),
    (setting(**NO_SWING | {"coverage95_deg": None}), {}, "UNKNOWN"),
    (setting(**NO_SWING | {"coverage95_deg": [0.0, math.inf]}), {}, "UNKNOWN"),
    (setting(), {"gateway": False}, "STALE"),
    (setting(), {"tilt": 1.2}, "STALE"),
    (setting(), {"tilt": 1.0}, "OK"),
    (setting(), {"condition": 1.6}, "STALE"),
    (setting(), {"alert": 2.1}, "STALE"),
    (setting(), {"swing": 4.0}, "OK"),  # half of its period of 6.9 s, and 1 s
    (setting(), {"swing": 5.0}, "STALE"),
    (setting(), {"health": 60.0, "calibration": 60.0}, "OK"),
    (setting(session=SUSPENDED), {}, "SUSPENDED"),
    (setting(session=SUSPENDED, level="unknown", calibration="uncalibrated", swinging=None), {}, "SUSPENDED"),
    (setting(session=SUSPENDED), {"tilt": 3.0}, "STALE"),
    (setting(session=replace(SUSPENDED, suspended=False)), {}, "OK"),
    # An alarm goes before doubt, and only lost data before an alarm.
    (setting(level="trip", calibration="uncalibrated"), {}, "TRIP"),
    (setting(level="warn", **DISTURBED), {}, "WARN"),
    (setting(level="trip"), {"tilt": 3.0}, "STALE"),
    (setting(calibration="uncalibrated", **DISTURBED), {}, "UNCALIBRATED"),
]


@pytest.mark.parametrize(("change", "circumstances", "word"), TABLE)
def test_the_verdict_follows_the_table(scene: Scene, change: Change, circumstances: dict[str, Any], word: str) -> None:
    change(scene)
    judged = verdict(evidence_of(scene, **circumstances))
    assert judged.word == word
    assert (judged.colour == "calm") == (word == "OK")
    assert bool(judged.reasons) == (word != "OK")


@pytest.mark.parametrize("validity", get_args(Validity))
@pytest.mark.parametrize("level", get_args(Level))
def test_the_page_is_never_calmer_than_what_receivers_of_alerts_are_told(
    scene: Scene, validity: Validity, level: Level
) -> None:
    scene.level = level
    whole = evidence_of(scene)
    alert = replace(present(whole.get(Alert)), validity=validity)
    judged = verdict(replace(whole, latest={**whole.latest, "alert": alert}))
    told = GatewayPresence(is_alive=True, alert=alert, alert_s=0.0, heard_s=0.0).judge(0.0, 1.0, is_linked=True)
    word = STATED_VERDICTS[told][0] if told in STATED_VERDICTS else None
    assert (word is None) == (told is GatewayState.FINE)
    assert judged.sound == (word is None and level != "unknown")
    if word is not None:
        assert word in (judged.word, *judged.also) or (word == "UNKNOWN" and judged.word != "OK")


@pytest.mark.parametrize("topic", USUAL_INTERVAL_S)
def test_nothing_is_calm_before_every_topic_was_received(scene: Scene, topic: str) -> None:
    whole = evidence_of(scene)
    latest: dict[str, Message] = {name: message for name, message in whole.latest.items() if name != topic}
    judged = verdict(PageEvidence(True, latest, whole.age_s, 1.0))
    assert judged.word == "UNKNOWN"
    assert topic in judged.reasons[0]


@pytest.mark.parametrize("gateway", [True, False])
def test_no_data_at_all(gateway: bool) -> None:
    judged = verdict(PageEvidence(gateway, {}, {}, 1.0))
    assert (judged.word, judged.sound) == ("NO DATA", False)


def test_an_alarm_is_listed_when_its_data_are_lost(scene: Scene) -> None:
    setting(level="trip", alert_text="swing trip: up to 8.1 deg")(scene)
    judged = verdict(evidence_of(scene, tilt=3.0))
    assert judged.also == ["TRIP"]
    assert judged.reasons == ["no new tilt for 3 s", "swing trip: up to 8.1 deg"]


@pytest.mark.parametrize(
    ("change", "also"),
    [
        (setting(level="warn", **DISTURBED), ["DISTURBED"]),
        (setting(level="warn", swinging=None), ["UNKNOWN"]),
        (setting(calibration="uncalibrated", level="unknown"), []),
        (setting(calibration="uncalibrated", **DISTURBED), ["DISTURBED"]),
    ],
)
def test_other_findings_are_listed_with_the_verdict(scene: Scene, change: Change, also: list[str]) -> None:
    change(scene)
    assert verdict(evidence_of(scene)).also == also


@pytest.mark.parametrize(
    ("change", "sound"),
    [
        (setting(), True),
        (setting(level="trip"), True),
        (setting(calibration="uncalibrated", level="trip"), False),
        (setting(**DISTURBED), False),
        (setting(swinging=None), False),
        (setting(session=SUSPENDED), False),
    ],
)
def test_a_sound_verdict_allows_trust_in_the_number(scene: Scene, change: Change, sound: bool) -> None:
    change(scene)
    assert verdict(evidence_of(scene)).sound is sound


def test_a_long_rope_becomes_stale_as_well(scene: Scene) -> None:
    whole = evidence_of(scene, swing=17.0)
    object.__setattr__(whole.latest["swing"], "period_s", 1e9)
    assert verdict(whole).word == "STALE"


def test_every_verdict_has_its_own_word_and_shape() -> None:
    assert len({face.shape for face in STYLES.values()}) == len(STYLES)
    assert len({face.label for face in STYLES.values()}) == len(STYLES)
    assert [word for word, face in STYLES.items() if face.colour == "calm"] == ["OK"]


def test_the_verdict_depends_on_published_topics() -> None:
    assert all(TOPICS[topic].published for topic in USUAL_INTERVAL_S)
