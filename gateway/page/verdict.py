"""The one verdict that the page shows, from all that is known: a pure function, green only when everything is right.

Each thing that is wrong is a finding: a word and a reason. The first word in the order of `FACES` that was found is the verdict,
the others are told beside it; OK is what is left when nothing was found. An alarm is hidden by nothing but the
loss of the data that it rests on, and then still told beside it.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

from gateway.messages import Alert, Calibration, CalibrationStatus, Condition, Level, Message, Swing
from gateway.topics import TOPIC_OF

Word = Literal["NO DATA", "STALE", "TRIP", "WARN", "SUSPENDED", "UNCALIBRATED", "DISTURBED", "UNKNOWN", "OK"]
M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class VerdictStyle:
    """How a verdict looks: told apart by word, by shape and by colour."""

    label: str
    colour: str
    shape: str


FACES: dict[Word, VerdictStyle] = {
    "NO DATA": VerdictStyle("NO DATA", "black", "empty"),
    "STALE": VerdictStyle("STALE", "black", "hourglass"),
    "TRIP": VerdictStyle("STOP", "red", "octagon"),
    "WARN": VerdictStyle("WARN", "amber", "triangle"),
    "SUSPENDED": VerdictStyle("SUSPENDED", "violet", "pause"),
    "UNCALIBRATED": VerdictStyle("UNCALIBRATED", "violet", "slash"),
    "DISTURBED": VerdictStyle("DISTURBED", "violet", "zigzag"),
    "UNKNOWN": VerdictStyle("UNKNOWN", "violet", "question"),
    "OK": VerdictStyle("OK", "green", "circle"),
}
"""In the order in which one goes before another."""

ALARMS = ("TRIP", "WARN")

USUAL_PAUSE_S = {"tilt": 0.1, "swing": 1.0, "condition": 0.5, "alert": 1.0}
"""What a verdict rests on, and the longest pause between two messages while all is well."""
LONGEST_SWING_PAUSE_S = 15.0
"""Half the period of the longest rope, beyond which a swing estimate is late whatever period it claims."""
TRUSTED_CALIBRATIONS = ("calibrated", "factory")


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that a verdict rests on."""

    gateway: bool
    """The gateway's liveliness token stands."""
    latest: Mapping[str, Message]
    """Newest message by topic."""
    age_s: Mapping[str, float]
    """By topic: time since a message came that told something newer than the one before."""
    stale_s: float

    def get(self, kind: type[M]) -> M | None:
        """Newest message of a kind."""
        message = self.latest.get(TOPIC_OF[kind].name)
        return message if isinstance(message, kind) else None


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict and its face."""

    word: Word
    label: str
    colour: str
    shape: str
    reasons: list[str]
    """Of the verdict first, then of what is told beside it."""
    also: list[str]
    """Labels of the other things found; beside a word of doubt, UNKNOWN would add nothing."""
    sound: bool
    """The number may be believed: fresh, calibrated, trusted and known."""


def verdict(evidence: Evidence) -> Verdict:
    """Judge the evidence."""
    order = list(FACES)
    findings = [
        *_freshness(evidence),
        *_alarm(evidence),
        *_session(evidence),
        *_calibration(evidence),
        *_trust(evidence),
    ]
    findings.sort(key=lambda finding: order.index(finding[0]))
    words = list(dict.fromkeys(word for word, _ in findings)) or ["OK"]
    face = FACES[words[0]]
    return Verdict(
        word=words[0],
        label=face.label,
        colour=face.colour,
        shape=face.shape,
        reasons=list(dict.fromkeys(reason for _, reason in findings if reason)),
        also=[FACES[word].label for word in words[1:] if word != "UNKNOWN" or words[0] in ALARMS],
        sound=set(words) <= {"OK", *ALARMS},
    )


def is_known(swing: Swing) -> bool:
    """Whether the swing is a number: an angle, or an upper bound where nothing swings."""
    if swing.swinging:
        return _finite(swing.phi_max_deg)
    return swing.swinging is False and swing.coverage95_deg is not None and _finite(swing.coverage95_deg[1])


def is_fresh(evidence: Evidence, topic: str) -> bool:
    """Whether a topic that a verdict rests on came within its usual pause and `stale_s`."""
    return evidence.age_s.get(topic, math.inf) <= _pause_s(evidence, topic) + evidence.stale_s


def _pause_s(evidence: Evidence, topic: str) -> float:
    swing = evidence.get(Swing)
    if topic == "swing" and swing is not None and swing.period_s is not None:
        return min(max(USUAL_PAUSE_S[topic], swing.period_s / 2), LONGEST_SWING_PAUSE_S)
    return USUAL_PAUSE_S[topic]


def _freshness(evidence: Evidence) -> Iterator[tuple[Word, str]]:
    missing = [topic for topic in USUAL_PAUSE_S if topic not in evidence.latest]
    if len(missing) == len(USUAL_PAUSE_S):
        yield "NO DATA", "no measurement received yet" if evidence.gateway else "the gateway does not answer"
        return
    if not evidence.gateway:
        yield "STALE", "the gateway is gone"
    late = [topic for topic in USUAL_PAUSE_S if topic in evidence.latest and not is_fresh(evidence, topic)]
    if late:
        yield "STALE", f"no new {', '.join(late)} for {max(evidence.age_s[topic] for topic in late):.0f} s"
    if missing:
        yield "UNKNOWN", f"no {', '.join(missing)} received yet"


def _alarm(evidence: Evidence) -> Iterator[tuple[Word, str]]:
    alert = evidence.get(Alert)
    if alert is None or alert.level == "normal":
        return
    words: dict[Level, Word] = {"warn": "WARN", "trip": "TRIP"}
    yield words.get(alert.level, "UNKNOWN"), alert.text or f"alert level {alert.level}"


def _session(evidence: Evidence) -> Iterator[tuple[Word, str]]:
    calibration = evidence.get(Calibration)
    if calibration is not None and calibration.session.suspended:
        session = calibration.session
        under_way = session.phase in ("collecting", "review")
        yield "SUSPENDED", "nobody watches the swing: " + ("the sensor is recalibrated" if under_way else session.text)


def _calibration(evidence: Evidence) -> Iterator[tuple[Word, str]]:
    said: list[tuple[CalibrationStatus, str]] = []
    if (calibration := evidence.get(Calibration)) is not None:
        said.append((calibration.status, calibration.text))
    if (condition := evidence.get(Condition)) is not None:
        said.append((condition.calibration, ""))
    doubted = [(status, text) for status, text in said if status not in TRUSTED_CALIBRATIONS]
    if doubted:
        status, text = doubted[0]
        yield "UNCALIBRATED", text or f"calibration: {status.replace('_', ' ')}"


def _trust(evidence: Evidence) -> Iterator[tuple[Word, str]]:
    condition, swing = evidence.get(Condition), evidence.get(Swing)
    if condition is not None and not (condition.trusted and condition.verdict not in ("disturbed", "unknown")):
        word: Word = "DISTURBED" if condition.verdict == "disturbed" else "UNKNOWN"
        yield word, "; ".join(condition.reasons) or "the reading cannot be trusted"
    if swing is not None and not is_known(swing):
        yield "UNKNOWN", "; ".join(swing.reasons) or "the swing is not known"


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
