"""The alert rules of a gateway with their states, incidents and changes."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from gateway.configuration.model import AlertsSection
from gateway.messages import CALIBRATION_RULE, ActiveAlert, AlertEventKind, CalibrationStatus, Level, Validity
from gateway.pipeline.alert_rules import ALERT_RULES, AlertRule
from gateway.pipeline.incidents import (
    Acknowledgement,
    Incident,
    IncidentRegister,
    acknowledged_text,
    change_text,
    limits_text,
    reading_text,
    refuted_text,
)
from gateway.stages.alerts import Reading, RuleState, event_between, judge, judge_alarm, next_step, overall_level
from gateway.stages.condition import ConditionResult
from gateway.units import degrees

URGENT: tuple[Validity, ...] = ("no_samples", "suspended", "uncalibrated")
"""Their begin and end do not wait for the next heartbeat."""


class ValidityMonitor:
    """Whether the levels of one pipeline's alerts are known, as one word for receivers, and when that must be sent at once."""

    def __init__(self) -> None:
        self.present: Validity = "not_known"

    def update(self, condition: ConditionResult, calibration: CalibrationStatus, swing: Reading | None) -> bool:
        """Take the present state; return whether receivers must know at once."""
        before, self.present = self.present, _validity(condition, calibration, swing)
        return before != self.present and (before in URGENT or self.present in URGENT)


def _validity(condition: ConditionResult, calibration: CalibrationStatus, swing: Reading | None) -> Validity:
    if condition.gates.get("fresh") is False:
        return "no_samples"
    if condition.gates.get("on_rope") is False:
        return "suspended"
    if calibration == "uncalibrated":
        return "uncalibrated"
    return "not_known" if swing is None or not math.isfinite(swing.value_rad) else "valid"


@dataclass(frozen=True, slots=True)
class AlertChange:
    """The change of a rule, or a heartbeat where `rule` is None, with the state of all rules at that time.

    Its fields are those of the message `Alert` with the same names.
    """

    rule: str | None
    event: AlertEventKind
    level: Level
    active: list[ActiveAlert]
    text: str
    incident: str | None = None
    """Id of the incident that the change belongs to."""
    limit_deg: float | None = None
    clear_deg: float | None = None
    largest_deg: float | None = None
    """Largest angle since the incident began, and the largest upper end of its interval."""
    largest_upper_deg: float | None = None
    change: str | None = None
    """The change as one line; None for a heartbeat."""
    acknowledged_by: str | None = None
    reason: str | None = None
    """What the person stated who acknowledged it."""


class AlertManager:
    """Holds the states of the rules."""

    def __init__(
        self, limits: AlertsSection, incidents: IncidentRegister, rules: Sequence[AlertRule] = ALERT_RULES
    ) -> None:
        self._limits = {rule.name: rule.limits(limits) for rule in rules}
        self._incidents = incidents
        self._states: dict[str, RuleState] = {}
        self._readings: dict[str, Reading | None] = dict.fromkeys(self._limits)
        self._why_unknown = "no reading yet"
        self._drift_alarm: str | None = None
        self._is_untrusted = False

    def judge(
        self,
        readings: Mapping[str, Reading | None],
        *,
        why_unknown: str,
        time_s: float,
        drift_alarm: str | None = None,
        is_untrusted: bool = False,
    ) -> Iterator[AlertChange]:
        """Compare the reading of each rule with its limits; yield one change for each rule whose level has changed.

        A known reading counts, whatever the crane does; None or missing: the angle is not known, and `why_unknown` states why.
        `drift_alarm` is the reason why the calibration can no longer be trusted; None: there is none. Readings that are not
        trusted can raise a level, and neither lower one nor count for the largest angle. A first value that was only an upper
        bound is corrected by a change of its own.
        """
        self._why_unknown = why_unknown
        before = dict(self._states)
        for rule, limits in self._limits.items():
            reading = self._readings[rule] = readings.get(rule)
            # before the first value nothing is "normal"
            state = before.setdefault(rule, RuleState("unknown", time_s))
            value_rad = None if reading is None else reading.value_rad
            self._states[rule] = judge(state, value_rad, limits, time_s, is_untrusted=is_untrusted)
        self._drift_alarm, self._is_untrusted = drift_alarm, is_untrusted
        state = before.setdefault(CALIBRATION_RULE, RuleState("normal", time_s))
        self._states[CALIBRATION_RULE] = judge_alarm(state, is_active=drift_alarm is not None, time_s=time_s)
        yield from self._changes(before, time_s)

    def suspend(self, why: str, time_s: float) -> Iterator[AlertChange]:
        """Make every rule unknown, because no reading describes the load."""
        self._why_unknown = why
        before = dict(self._states)
        self._drift_alarm = None
        for rule in self._limits:
            self._readings[rule] = None
            state = before.setdefault(rule, RuleState("normal", time_s))
            if state.level != "unknown":
                self._states[rule] = RuleState("unknown", time_s)
        if CALIBRATION_RULE in self._states and self._states[CALIBRATION_RULE].level == "warn":
            self._states[CALIBRATION_RULE] = RuleState("unknown", time_s)
        yield from self._changes(before, time_s)

    def acknowledge(self, acknowledgement: Acknowledgement, time_ns: int) -> AlertChange | None:
        """Note that a person knows of an incident; None where it is not known, or was acknowledged at its present level."""
        incident = self._incidents.find(acknowledgement.incident)
        if incident is None or incident.acknowledged_by is not None:
            return None
        incident.acknowledged_by, incident.acknowledged_ns = acknowledgement.by, time_ns
        limits = self._limits.get(incident.rule)
        largest_deg, largest_upper_deg = _largest_deg(incident)
        return replace(
            self._summary(incident.rule, "acknowledged"),
            incident=incident.id,
            limit_deg=_rounded_degrees(incident.limit_rad),
            clear_deg=None if limits is None else _rounded_degrees(limits.clear_rad),
            largest_deg=largest_deg,
            largest_upper_deg=largest_upper_deg,
            acknowledged_by=acknowledgement.by,
            reason=acknowledgement.reason or None,
            change=acknowledged_text(acknowledgement, incident),
        )

    def heartbeat(self) -> AlertChange:
        """Return the state of all rules, without a change."""
        return self._summary(None, "standing")

    def _changes(self, before: Mapping[str, RuleState], time_s: float) -> Iterator[AlertChange]:
        """Yield the changes, after all rules are judged: each states the levels of all of them."""
        found: list[tuple[str, AlertEventKind, Incident | None]] = []
        for rule, state in self._states.items():
            event = event_between(before[rule], state)
            limit_rad, _clear_rad = self._levels_rad(rule)
            event, incident = self._incidents.update(
                rule,
                event,
                state.level,
                self._readings.get(rule),
                limit_rad,
                time_s,
                is_untrusted=self._is_untrusted,
            )
            if event != "standing":
                found.append((rule, event, incident))
        for rule, event, incident in found:
            yield self._change(rule, event, incident, time_s)

    def _change(self, rule: str, event: AlertEventKind, incident: Incident | None, time_s: float) -> AlertChange:
        """Return the change of one rule."""
        limit_rad, clear_rad = self._levels_rad(rule)
        largest_deg, largest_upper_deg = _largest_deg(incident)
        if incident is not None and event in ("cleared", "corrected"):
            limit_rad = incident.limit_rad
        return replace(
            self._summary(rule, event),
            incident=None if incident is None else incident.id,
            limit_deg=_rounded_degrees(limit_rad),
            clear_deg=_rounded_degrees(clear_rad),
            largest_deg=largest_deg,
            largest_upper_deg=largest_upper_deg,
            change=change_text(rule, event, self._states[rule].level, self._reason(rule), incident, time_s),
        )

    def _summary(self, rule: str | None, event: AlertEventKind) -> AlertChange:
        active = [self._active(name) for name, state in self._states.items() if state.level != "normal"]
        level = overall_level([state.level for state in self._states.values()])
        text = "; ".join(alert.text for alert in active) or "all normal"
        return AlertChange(rule, event, level, active, text)

    def _active(self, rule: str) -> ActiveAlert:
        state, reading, incident = self._states[rule], self._readings.get(rule), self._incidents.get(rule)
        limit_rad, clear_rad = self._levels_rad(rule)
        largest_deg, largest_upper_deg = _largest_deg(incident)
        limits = self._limits.get(rule)
        step = None if limits is None else next_step(state, limits)
        return ActiveAlert(
            rule=rule,
            level=state.level,
            since_ns=round(state.since_s * 1e9),
            value_deg=None if reading is None else degrees(reading.value_rad),
            limit_deg=_rounded_degrees(limit_rad),
            clear_deg=_rounded_degrees(clear_rad),
            ends_in_s=None if step is None or step.in_s is None else round(step.in_s, 1),
            next_level=None if step is None else step.level,
            next_below_deg=None if step is None else _rounded_degrees(step.below_rad),
            expected_in_s=None if reading is None else round(reading.expected_in_s, 1),
            estimate_deg=None if reading is None else degrees(reading.best_rad),
            is_bound=None if reading is None else reading.is_bound(limit_rad),
            incident=None if incident is None else incident.id,
            largest_deg=largest_deg,
            largest_upper_deg=largest_upper_deg,
            acknowledged_by=None if incident is None else incident.acknowledged_by,
            acknowledged_ns=None if incident is None else incident.acknowledged_ns,
            text=self._state_text(rule),
        )

    def _state_text(self, rule: str) -> str:
        level = self._states[rule].level
        if level == "unknown":
            return f"{rule} unknown: {self._reason(rule)}"
        return f"{rule}: {self._reason(rule)}" if rule == CALIBRATION_RULE else f"{rule} {level}: {self._reason(rule)}"

    def _reason(self, rule: str) -> str:
        """Return the reading of a rule with its limits, or why there is none."""
        level, reading = self._states[rule].level, self._readings.get(rule)
        if level == "unknown":
            return self._why_unknown
        if rule == CALIBRATION_RULE:
            return self._drift_alarm or ""
        incident = self._incidents.get(rule)
        limit_rad, clear_rad = self._levels_rad(rule)
        limits = limits_text(limit_rad, clear_rad)
        if incident is not None and incident.is_refuted:
            limits = f"{refuted_text(incident)}, clears below {math.degrees(clear_rad):.1f} deg"
        return f"{reading_text(reading, limit_rad)} ({limits})"

    def _levels_rad(self, rule: str) -> tuple[float, float]:
        """Return the limit of a rule at its level, and its clear level; infinite for the calibration, which has none."""
        if rule == CALIBRATION_RULE:
            return math.inf, math.inf
        limits = self._limits[rule]
        if self._states[rule].level == "warn" and limits.warn_rad is not None:
            return limits.warn_rad, limits.clear_rad
        return limits.trip_rad, limits.clear_rad


def _largest_deg(incident: Incident | None) -> tuple[float | None, float | None]:
    """Return the largest angle of an incident and the largest upper end of its interval; None where no angle was known."""
    if incident is None or not math.isfinite(incident.known_s):
        return None, None
    return degrees(incident.largest_rad), degrees(incident.largest_upper_rad)


def _rounded_degrees(angle_rad: float) -> float | None:
    """Return a level in degrees as it was configured, without the last digits of the conversion; None for an infinite one."""
    return round(math.degrees(angle_rad), 9) if math.isfinite(angle_rad) else None
