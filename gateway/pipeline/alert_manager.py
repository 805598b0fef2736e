"""The alert rules of a gateway, and the line of text that an operator reads."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from gateway.configuration.model import AlertsSection
from gateway.messages import ActiveAlert, Level
from gateway.stages.alerts import Event, Limits, RuleState, event_between, initial_state, judge, overall_level
from gateway.units import degrees

LEAN_CLEAR_SHARE = 0.8
"""The lean alert clears below this share of its limit."""
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
    """Holds the states of the rules. Angles are upper confidence limits in radians; None: not known."""

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
        self._values_rad: dict[str, float | None] = dict.fromkeys(self._limits)
        self._why_unknown = "no reading yet"
        self._drift_alarm: str | None = None

    def judge(
        self,
        values_rad: dict[str, float | None],
        *,
        trusted: bool,
        why_unknown: str,
        time_s: float,
        drift_alarm: str | None = None,
    ) -> Iterator[AlertChange]:
        """Compare the values with the limits; yield one change for each rule whose level has changed.

        A reading that is not trusted may raise an alert. It never clears one, and below the limits it counts as unknown.
        `drift_alarm` is the reason why the calibration can no longer be trusted; None: there is none.
        """
        self._why_unknown = why_unknown
        changed: list[tuple[str, Event]] = []
        for rule, limits in self._limits.items():
            value_rad = values_rad[rule]
            raises_rad = limits.trip_rad if limits.warn_rad is None else limits.warn_rad
            if value_rad is not None and not trusted and value_rad < raises_rad:
                value_rad = None
            self._values_rad[rule] = value_rad
            before = self._states.get(rule) or RuleState(
                "unknown", time_s
            )  # before the first value nothing is "normal"
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
        self._states[CALIBRATION] = initial_state(before, stands=drift_alarm is not None, time_s=time_s)
        event = event_between(before, self._states[CALIBRATION])
        if event != "standing":
            yield CALIBRATION, event

    def suspend(self, why: str, time_s: float) -> Iterator[AlertChange]:
        """Make every rule unknown, because no reading describes the load."""
        self._why_unknown = why
        changed: list[tuple[str, Event]] = []
        self._drift_alarm = None
        for rule in self._limits:
            self._values_rad[rule] = None
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
        state, limits, value_rad = self._states[rule], self._limits[rule], self._values_rad[rule]
        limit_rad = limits.warn_rad if state.level == "warn" else limits.trip_rad
        return ActiveAlert(
            rule=rule,
            level=state.level,
            since_ns=round(state.since_s * 1e9),
            value_deg=degrees(value_rad),
            limit_deg=None if limit_rad is None else round(math.degrees(limit_rad), 9),
            text=_text(rule, state.level, value_rad, limit_rad, self._why_unknown),
        )

    def _active_calibration(self, state: RuleState) -> ActiveAlert:
        known = self._drift_alarm is not None
        return ActiveAlert(
            rule=CALIBRATION,
            level=state.level,
            since_ns=round(state.since_s * 1e9),
            value_deg=None,
            limit_deg=None,
            text=f"{CALIBRATION}: {self._drift_alarm}" if known else f"{CALIBRATION} unknown: {self._why_unknown}",
        )


def _text(rule: str, level: Level, value_rad: float | None, limit_rad: float | None, why_unknown: str) -> str:
    if level == "unknown":
        return f"{rule} unknown: {why_unknown}"
    now = "not known now" if value_rad is None else f"up to {math.degrees(value_rad):.1f} deg now"
    limit = "" if limit_rad is None else f" (limit {math.degrees(limit_rad):.1f} deg)"
    return f"{rule} {level}: {now}{limit}"
