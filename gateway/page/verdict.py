"""The one verdict of the page: a pure function, calm only when everything is right.

Each problem is a finding: a word and a reason. The first word found, in the order of `STYLES`, is the verdict, and the others
are listed as well; without a finding it is OK. Only missing data take precedence over an alarm, which is then listed.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

from gateway.gateway_state import HEARTBEAT_S, GatewayState, is_overdue, stated_state
from gateway.messages import Alert, Calibration, CalibrationStatus, Condition, Level, Message, Swing
from gateway.topics import TOPIC_OF

Word = Literal[
    "NO DATA", "STALE", "TRIP", "WARN", "NOT AUTHENTICATED", "SUSPENDED", "UNCALIBRATED", "DISTURBED", "UNKNOWN", "OK"
]
M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class VerdictStyle:
    """The look of a verdict: its word, shape and colour each identify it."""

    label: str
    colour: str
    shape: str


STYLES: dict[Word, VerdictStyle] = {
    "NO DATA": VerdictStyle("NO DATA", "black", "empty"),
    "STALE": VerdictStyle("STALE", "black", "hourglass"),
    "TRIP": VerdictStyle("LIMIT", "red", "octagon"),
    "WARN": VerdictStyle("WARNING", "amber", "triangle"),
    "NOT AUTHENTICATED": VerdictStyle("NOT AUTHENTICATED", "violet", "mask"),
    "SUSPENDED": VerdictStyle("SUSPENDED", "violet", "pause"),
    "UNCALIBRATED": VerdictStyle("UNCALIBRATED", "violet", "slash"),
    "DISTURBED": VerdictStyle("DISTURBED", "grey", "zigzag"),
    "UNKNOWN": VerdictStyle("NOT KNOWN", "grey", "question"),
    "OK": VerdictStyle("OK", "calm", "circle"),
}
"""In the order of precedence."""

ALARMS: tuple[Word, ...] = ("TRIP", "WARN")

USUAL_INTERVAL_S = {"tilt": 0.1, "swing": 1.0, "condition": 0.5, "alert": HEARTBEAT_S}
"""The topics on which a verdict depends, and the longest usual interval between two messages. Definition: the periods at which
the pipeline sends them."""
MAX_SWING_AGE_S = 15.0
"""Half the period of the longest rope; a swing estimate that is older is late, whatever its period. Basis: a rope of 220 m swings
in 30 s."""
STATED_VERDICTS: dict[GatewayState, tuple[Word, str]] = {
    GatewayState.SENSOR_GONE: ("STALE", "no samples come from the sensor"),
    GatewayState.SUSPENDED: ("SUSPENDED", "the swing is not monitored"),
    GatewayState.UNCALIBRATED: ("UNCALIBRATED", "the sensor has no calibration"),
    GatewayState.NOT_KNOWN: ("UNKNOWN", "the levels of the alerts are not known"),
}
"""Word and reason where the gateway tells receivers of its alerts that the levels are not known: the page is never calmer."""
TRUSTED_CALIBRATIONS = ("calibrated", "factory")


@dataclass(frozen=True, slots=True)
class PageEvidence:
    """Everything on which a verdict depends."""

    gateway: bool
    """The gateway is there, whatever it measures."""
    latest: Mapping[str, Message]
    """Newest message by topic."""
    age_s: Mapping[str, float]
    """Time since the last message with a newer sample, by topic."""
    stale_s: float
    judged: tuple[str, ...] = tuple(USUAL_INTERVAL_S)
    """The topics whose freshness counts: those that are received here."""
    doubt: str | None = None
    """Why the messages are not authenticated; None: they are. Those of a gateway's own page come from its own process."""

    def get(self, kind: type[M]) -> M | None:
        """Return the newest message of a type."""
        message = self.latest.get(TOPIC_OF[kind].name)
        return message if isinstance(message, kind) else None


@dataclass(frozen=True, slots=True)
class PageVerdict:
    """The verdict and its look."""

    word: Word
    label: str
    colour: str
    shape: str
    reasons: list[str]
    """The reasons of the verdict first, then those of the other findings."""
    also: list[Word]
    """Words of the other findings; UNKNOWN is listed only with an alarm."""
    sound: bool
    """Whether the value can be trusted: it is fresh, calibrated, trusted and known."""


def verdict(evidence: PageEvidence) -> PageVerdict:
    """Judge the evidence."""
    order = list(STYLES)
    findings = [
        *_freshness(evidence),
        *_alarm(evidence),
        *_authenticity(evidence),
        *_session(evidence),
        *_calibration(evidence),
        *_trust(evidence),
        *_stated(evidence),
    ]
    findings.sort(key=lambda finding: order.index(finding[0]))
    words = list(dict.fromkeys(word for word, _ in findings)) or ["OK"]
    face = STYLES[words[0]]
    return PageVerdict(
        word=words[0],
        label=face.label,
        colour=face.colour,
        shape=face.shape,
        reasons=list(dict.fromkeys(reason for _, reason in findings if reason)),
        also=[word for word in words[1:] if word != "UNKNOWN" or words[0] in ALARMS],
        sound=set(words) <= {"OK", *ALARMS},
    )


def is_swing_known(swing: Swing) -> bool:
    """Return whether the swing is known: an angle, or an upper limit where there is no swing."""
    if swing.swinging:
        return _finite(swing.phi_max_deg)
    return swing.swinging is False and swing.coverage95_deg is not None and _finite(swing.coverage95_deg[1])


def is_fresh(evidence: PageEvidence, topic: str) -> bool:
    """Return whether the last message of a topic came within its usual interval plus `stale_s`."""
    return not is_overdue(evidence.age_s.get(topic, math.inf), evidence.stale_s, _interval_s(evidence, topic))


def _interval_s(evidence: PageEvidence, topic: str) -> float:
    swing = evidence.get(Swing)
    if topic == "swing" and swing is not None and swing.period_s is not None:
        return min(max(USUAL_INTERVAL_S[topic], swing.period_s / 2), MAX_SWING_AGE_S)
    return USUAL_INTERVAL_S[topic]


def _freshness(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    missing = [topic for topic in evidence.judged if topic not in evidence.latest]
    if len(missing) == len(evidence.judged):
        yield "NO DATA", "no measurement received yet" if evidence.gateway else "the gateway does not answer"
        return
    if not evidence.gateway:
        yield "STALE", "the gateway has stopped, hangs or is disconnected"
    late = [topic for topic in evidence.judged if topic in evidence.latest and not is_fresh(evidence, topic)]
    if late:
        yield "STALE", f"no new {', '.join(late)} for {max(evidence.age_s[topic] for topic in late):.0f} s"
    if missing:
        yield "UNKNOWN", f"no {', '.join(missing)} received yet"


def _alarm(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    alert = evidence.get(Alert)
    if alert is None or alert.level == "normal":
        return
    words: dict[Level, Word] = {"warn": "WARN", "trip": "TRIP"}
    yield words.get(alert.level, "UNKNOWN"), alert.text or f"alert level {alert.level}"


def _authenticity(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    if evidence.doubt is not None:
        yield "NOT AUTHENTICATED", f"not authenticated: {evidence.doubt}"


def _session(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    calibration = evidence.get(Calibration)
    if calibration is not None and calibration.session.suspended:
        session = calibration.session
        active = session.phase in ("collecting", "review")
        yield (
            "SUSPENDED",
            "the swing is not monitored: " + ("the sensor is being recalibrated" if active else session.text),
        )


def _calibration(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    said: list[tuple[CalibrationStatus, str]] = []
    if (calibration := evidence.get(Calibration)) is not None:
        said.append((calibration.status, calibration.text))
    if (condition := evidence.get(Condition)) is not None:
        said.append((condition.calibration, ""))
    doubted = [(status, text) for status, text in said if status not in TRUSTED_CALIBRATIONS]
    if doubted:
        status, text = doubted[0]
        yield "UNCALIBRATED", text or f"calibration: {status.replace('_', ' ')}"


def _trust(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    condition, swing = evidence.get(Condition), evidence.get(Swing)
    if condition is not None and not (condition.trusted and condition.verdict not in ("disturbed", "unknown")):
        word: Word = "DISTURBED" if condition.verdict == "disturbed" else "UNKNOWN"
        yield word, "; ".join(condition.reasons) or "the reading cannot be trusted"
    if swing is not None and not is_swing_known(swing):
        yield "UNKNOWN", "; ".join(swing.reasons) or "the swing is not known"


def _stated(evidence: PageEvidence) -> Iterator[tuple[Word, str]]:
    alert = evidence.get(Alert)
    if (
        alert is not None
        and alert.validity is not None
        and (finding := STATED_VERDICTS.get(stated_state(alert))) is not None
    ):
        yield finding


def _finite(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
