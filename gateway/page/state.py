"""The state of the page: the latest message of each topic, its age, and the verdict.

All methods are called from one thread, with the time on the page process's monotonic clock.
"""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

from pydantic import ValidationError

from gateway.calibration.alignment.assistant import AlignmentAssistant, AlignmentReadout
from gateway.calibration.alignment.turn_assistant import TurnAssistant, TurnReadout, format_errors, format_turn
from gateway.gateway_state import is_overdue
from gateway.messages import SCHEMA_VERSION, Alert, Calibration, Message, Motion, Swing, Tilt
from gateway.page.channel import PAST_ALERT, Frame, Parameters
from gateway.page.history import AlertLog, History
from gateway.page.verdict import PageEvidence, PageVerdict, is_fresh, is_swing_known, verdict
from gateway.topics import adapter

MEASURED_TOPICS = ("tilt", "motion", "swing", "condition")
"""A message of these topics is new only if it describes a newer sample; a repeated one must not look fresh."""
GATEWAY_PATIENCE_S = 2.0
"""The gateway has hung if the next message of any topic is overdue by this time. Basis: a choice; its health comes every second,
so that three are missing."""


@dataclass(frozen=True, slots=True)
class LastValidSwing:
    """The last swing with a sound verdict."""

    at_s: float
    swing: Swing


class PageState:
    """Latest messages, history and verdict of one sensor."""

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.history = History()
        self.alert_log = AlertLog()
        self.received: dict[str, int] = {}
        self.invalid = 0
        """Number of payloads that are not a valid message of their topic."""
        self._heard_s = -math.inf
        self._latest: dict[str, Message] = {}
        self._newest_s: dict[str, float] = {}
        self._last_valid: LastValidSwing | None = None
        self._aligning = AlignmentAssistant()
        self._alignment: AlignmentReadout | None = None
        self._turning = TurnAssistant()
        self._turn: TurnReadout | None = None

    def receive(self, frames: Iterable[Frame]) -> None:
        """Take messages of the gateway, and judge the swing by all of them."""
        before = dict(self._latest)
        for frame in frames:
            self._receive(frame)
        motion, swing = self._latest.get("motion"), self._latest.get("swing")
        if isinstance(motion, Motion) and motion is not before.get("motion"):
            at_s = self._newest_s["motion"]
            self.history.add(motion, sound=self.verdict(at_s).sound, at_s=at_s)
        if (
            isinstance(swing, Swing)
            and swing is not before.get("swing")
            and self.verdict(self._newest_s["swing"]).sound
        ):
            self._last_valid = LastValidSwing(self._newest_s["swing"], swing)

    def _receive(self, frame: Frame) -> None:
        topic = "alert" if frame.kind == PAST_ALERT else frame.kind
        try:
            message: Message = adapter(topic).validate_json(frame.payload)
        except (KeyError, ValidationError):
            self.invalid += 1
            return
        if frame.kind == PAST_ALERT and isinstance(message, Alert):
            self.alert_log.add(message)
            return
        self._heard_s = max(self._heard_s, frame.at_s)
        self.received[topic] = self.received.get(topic, 0) + 1
        before = self._latest.get(topic)
        if topic not in MEASURED_TOPICS or before is None or message.time_ns != before.time_ns:
            self._newest_s[topic] = frame.at_s
        self._latest[topic] = message
        self._follow(message, before)

    def _follow(self, message: Message, before: Message | None) -> None:
        """Update what depends on more than the last message of a topic."""
        match message:
            case Alert():
                self.alert_log.add(message)
            case Tilt() if before is None or message.time_ns != before.time_ns:
                self._alignment = self._aligning.add_tilt(message)
                self._turn = self._turning.add_tilt(message)
            case Calibration():
                self._turning.set_gain(message.in_force.get("gain_g_per_unit"))

    def tick(self, now_s: float) -> None:
        """Note a gap in the history while data are missing."""
        if self.verdict(now_s).word in ("NO DATA", "STALE"):
            self.history.add_gap(at_s=now_s)

    def evidence(self, now_s: float) -> PageEvidence:
        """Return everything on which the verdict and the metrics depend."""
        age_s = {topic: max(now_s - at_s, 0.0) for topic, at_s in self._newest_s.items()}
        is_heard = not is_overdue(now_s - self._heard_s, GATEWAY_PATIENCE_S)
        return PageEvidence(is_heard, dict(self._latest), age_s, self.parameters.stale_s)

    def verdict(self, now_s: float) -> PageVerdict:
        """Return the present verdict."""
        return verdict(self.evidence(now_s))

    def snapshot(self, now_s: float) -> dict[str, Any]:
        """Return the content of `/api/state`."""
        evidence = self.evidence(now_s)
        judged = verdict(evidence)
        swing = evidence.get(Swing)
        return {
            "schema_version": SCHEMA_VERSION,
            "now_s": round(now_s, 3),
            "time_ns": max((message.time_ns for message in evidence.latest.values()), default=0),
            "gateway": evidence.gateway,
            "verdict": asdict(judged),
            "swing_known": swing is not None and is_swing_known(swing),
            "last_good": self._last_sound_now(now_s),
            "align": asdict(self._alignment) if self._alignment is not None and is_fresh(evidence, "tilt") else None,
            "align_turn": None
            if self._turn is None or not is_fresh(evidence, "tilt")
            else {**asdict(self._turn), "text": format_turn(self._turn), "errors": format_errors(self._turn)},
            "age_s": {topic: round(age, 3) for topic, age in evidence.age_s.items()},
            "topics": evidence.latest,
            "alert_log": {"since_ns": self.alert_log.since_ns, "alerts": self.alert_log.alerts()},
            "page": self._page(),
        }

    def summary(self, now_s: float) -> dict[str, Any]:
        """Return the content of a push: the snapshot without the calibration record, which browsers do not show."""
        state = self.snapshot(now_s)
        calibration = state["topics"].get("calibration")
        if isinstance(calibration, Calibration):
            state["topics"] = {**state["topics"], "calibration": replace(calibration, record={})}
        return state

    def _last_sound_now(self, now_s: float) -> dict[str, float | None] | None:
        if self._last_valid is None:
            return None
        return {
            "age_s": round(now_s - self._last_valid.at_s, 3),
            "phi_max_deg": self._last_valid.swing.phi_max_deg if self._last_valid.swing.swinging else None,
        }

    def _page(self) -> dict[str, Any]:
        p = self.parameters
        return {
            "key": p.key,
            **p.place,
            "title": p.title,
            "warn_deg": p.warn_deg,
            "trip_deg": p.trip_deg,
            "clear_deg": p.clear_deg,
            "lean_trip_deg": p.lean_trip_deg,
            "stale_s": p.stale_s,
            "language": p.language,
            "names": p.names,
            "directions": p.directions,
            "invalid": self.invalid,
        }
