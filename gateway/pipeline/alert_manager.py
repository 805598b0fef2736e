"""The alert rules of a gateway, and the line of text that an operator reads."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from gateway.configuration.model import AlertsSection
from gateway.messages import ActiveAlert, Level
from gateway.stages.alerts import Event, Limits, Reading, RuleState, event_between, judge, judge_alarm, overall_level
from gateway.units import degrees

LEAN_CLEAR_SHARE = 0.8
"""The lean alert clears below this share of its limit."""
SHORTEST_LEAD_S = 0.05
"""A peak that comes sooner is the present angle. Definition: the resolution of the text."""
CALIBRATION = "calibration"
"""The rule of the drift monitor, which has its own hold time."""


@dataclass(frozen=True, slots=True)
class AlertChange:
    """The change of a rule, or a heartbeat where `rule` is None, with the state of all rules at that time."""

    rule: str | None
    event: Event
    level: Level
    active: list[ActiveAlert]
    text: str


class AlertManager:
    """Holds the states of the rules."""

    def __init__(self, limits: AlertsSection) -> None:
        self._limits = {
            "swing": Limits(
                trip_rad=math.radians(limits.trip_deg),
                clear_rad=math.radians(limits.clear_deg),
                hold_s=limits.hold_s,
                warn_rad=math.radians(limits.warn_deg),
            ),
            "lean": Limits(
                trip_rad=math.radians(limits.lean_trip_deg),
                clear_rad=LEAN_CLEAR_SHARE * math.radians(limits.lean_trip_deg),
                hold_s=limits.hold_s,
            ),
        }
        self._states: dict[str, RuleState] = {}
        self._readings: dict[str, Reading | None] = dict.fromkeys(self._limits)
        self._why_unknown = "no reading yet"
        self._drift_alarm: str | None = None

    def judge(
        self,
        readings: Mapping[str, Reading | None],
        *,
        why_unknown: str,
        time_s: float,
        drift_alarm: str | None = None,
    ) -> Iterator[AlertChange]:
        """Compare the reading of each rule with its limits; yield one change for each rule whose level has changed.

        A known reading counts, whatever the crane does; None: the angle is not known, and `why_unknown` states why.
        `drift_alarm` is the reason why the calibration can no longer be trusted; None: there is none.
        """
        self._why_unknown = why_unknown
        changed: list[tuple[str, Event]] = []
        for rule, limits in self._limits.items():
            reading = self._readings[rule] = readings[rule]
            # before the first value nothing is "normal"
            before = self._states.get(rule) or RuleState("unknown", time_s)
            value_rad = None if reading is None else reading.value_rad
            self._states[rule] = judge(before, value_rad, limits, time_s)
            event = event_between(before, self._states[rule])
            if event != "standing":
                changed.append((rule, event))
        changed += self._judge_calibration(drift_alarm, time_s)
        for rule, event in changed:  # after all rules are judged: each message states the levels of all of them
            yield self._change(rule, event)

    def _judge_calibration(self, drift_alarm: str | None, time_s: float) -> Iterator[tuple[str, Event]]:
        self._drift_alarm = drift_alarm
        before = self._states.get(CALIBRATION) or RuleState("normal", time_s)
        self._states[CALIBRATION] = judge_alarm(before, is_active=drift_alarm is not None, time_s=time_s)
        event = event_between(before, self._states[CALIBRATION])
        if event != "standing":
            yield CALIBRATION, event

    def suspend(self, why: str, time_s: float) -> Iterator[AlertChange]:
        """Make every rule unknown, because no reading describes the load."""
        self._why_unknown = why
        changed: list[tuple[str, Event]] = []
        self._drift_alarm = None
        for rule in self._limits:
            self._readings[rule] = None
            before = self._states.get(rule)
            if before is None or before.level != "unknown":
                self._states[rule] = RuleState("unknown", time_s)
                changed.append((rule, "changed"))
        if CALIBRATION in self._states and self._states[CALIBRATION].level == "warn":
            self._states[CALIBRATION] = RuleState("unknown", time_s)
            changed.append((CALIBRATION, "changed"))
        for rule, event in changed:
            yield self._change(rule, event)

    def heartbeat(self) -> AlertChange:
        """Return the state of all rules, without a change."""
        return self._change(None, "standing")

    def _change(self, rule: str | None, event: Event) -> AlertChange:
        active = [self._active(name) for name, state in self._states.items() if state.level != "normal"]
        level = overall_level([state.level for state in self._states.values()])
        text = "; ".join(alert.text for alert in active) or "all normal"
        return AlertChange(rule, event, level, active, text)

    def _active(self, rule: str) -> ActiveAlert:
        if rule == CALIBRATION:
            return self._active_calibration(self._states[rule])
        state, limits, reading = self._states[rule], self._limits[rule], self._readings[rule]
        limit_rad = limits.warn_rad if state.level == "warn" and limits.warn_rad is not None else limits.trip_rad
        limit_deg, clear_deg = round(math.degrees(limit_rad), 9), round(math.degrees(limits.clear_rad), 9)
        if state.level == "unknown":
            text = f"{rule} unknown: {self._why_unknown}"
        else:
            levels = f"limit {limit_deg:.1f} deg, clears below {clear_deg:.1f} deg"
            text = f"{rule} {state.level}: {_reading_text(reading)} ({levels})"
        return ActiveAlert(
            rule=rule,
            level=state.level,
            since_ns=round(state.since_s * 1e9),
            value_deg=None if reading is None else degrees(reading.value_rad),
            limit_deg=limit_deg,
            clear_deg=clear_deg,
            text=text,
        )

    def _active_calibration(self, state: RuleState) -> ActiveAlert:
        known = self._drift_alarm is not None
        return ActiveAlert(
            rule=CALIBRATION,
            level=state.level,
            since_ns=round(state.since_s * 1e9),
            value_deg=None,
            limit_deg=None,
            clear_deg=None,
            text=f"{CALIBRATION}: {self._drift_alarm}" if known else f"{CALIBRATION} unknown: {self._why_unknown}",
        )


def _reading_text(reading: Reading | None) -> str:
    value_deg = None if reading is None else degrees(reading.value_rad)
    if reading is None or value_deg is None:
        return "not known now"
    when = "now" if reading.expected_in_s < SHORTEST_LEAD_S else f"expected in {reading.expected_in_s:.1f} s"
    return f"up to {value_deg:.1f} deg {when}"
