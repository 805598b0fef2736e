"""The alert rules of a gateway over a course of readings, and what an operator reads of them."""

import math

import pytest

from gateway.configuration.model import AlertsSection
from gateway.messages import ActiveAlert
from gateway.pipeline.alert_manager import AlertChange, AlertManager
from gateway.stages.alerts import Reading

LIMITS = AlertsSection(warn_deg=4.0, trip_deg=6.0, clear_deg=3.0, hold_s=2.0, lean_trip_deg=3.0)
STEP_S = 0.1
BELOW = Reading(math.radians(1.0))


class Site:
    """An alert manager with the changes that it made."""

    def __init__(self) -> None:
        self.manager = AlertManager(LIMITS)
        self.changes: list[AlertChange] = []
        self.now_s = 100.0

    def feed(
        self, swing_deg: float | None, seconds: float = STEP_S, *, in_s: float = 0.0, lean_deg: float | None = 1.0
    ) -> "Site":
        """Judge the same readings every tenth of a second."""
        swing = None if swing_deg is None else Reading(math.radians(swing_deg), in_s)
        lean = None if lean_deg is None else Reading(math.radians(lean_deg))
        for _ in range(round(seconds / STEP_S)):
            readings = {"swing": swing, "lean": lean}
            self.changes += self.manager.judge(readings, why_unknown="no angle", time_s=self.now_s)
            self.now_s += STEP_S
        return self

    @property
    def events(self) -> list[tuple[str | None, str, str]]:
        return [(change.rule, change.event, change.level) for change in self.changes]

    def active(self, rule: str = "swing") -> ActiveAlert:
        (found,) = (alert for alert in self.manager.heartbeat().active if alert.rule == rule)
        return found


def test_a_trip_steps_down_and_clears() -> None:
    site = Site().feed(1.0).feed(7.0, 1.0).feed(4.5, 3.0).feed(3.5, 5.0).feed(2.0, 3.0)
    assert site.events == [
        ("swing", "changed", "normal"),
        ("lean", "changed", "normal"),
        ("swing", "raised", "trip"),
        ("swing", "changed", "warn"),
        ("swing", "cleared", "normal"),
    ]


def test_an_alert_clears_from_known_values_alone_whatever_the_condition() -> None:
    site = Site().feed(7.0).feed(1.0, 1.9)
    assert site.active().level == "trip"
    site.feed(1.0, 0.3)
    assert site.manager.heartbeat().text == "all normal"


def test_before_the_first_reading_every_rule_is_unknown() -> None:
    site = Site().feed(None, 5.0, lean_deg=None)
    assert site.changes == []
    assert site.manager.heartbeat().level == "unknown"
    assert site.active().text == "swing unknown: no angle"


def test_a_missed_update_changes_nothing_and_a_longer_loss_is_unknown() -> None:
    site = Site().feed(1.0)
    before = len(site.changes)
    site.feed(None, 0.9).feed(1.0)
    assert len(site.changes) == before
    site.feed(None, 1.5)
    assert site.events[before:] == [("swing", "changed", "unknown")]


def test_a_trip_that_is_not_known_stands_and_clears_when_it_is_known_again() -> None:
    site = Site().feed(7.0).feed(None, 600.0)
    assert site.active().level == "trip"
    assert site.active().value_deg is None
    assert site.active().text == "swing trip: not known now (limit 6.0 deg, clears below 3.0 deg)"
    site.feed(2.0, 1.9)
    assert site.active().level == "trip"
    site.feed(2.0, 0.3)
    assert site.events[-1] == ("swing", "cleared", "normal")


def test_the_text_of_a_present_angle() -> None:
    alert = Site().feed(6.44).active()
    assert alert.text == "swing trip: up to 6.4 deg now (limit 6.0 deg, clears below 3.0 deg)"
    assert alert.value_deg == pytest.approx(6.44)
    assert (alert.limit_deg, alert.clear_deg) == (6.0, 3.0)


def test_the_text_of_a_coming_peak_states_when_it_comes() -> None:
    alert = Site().feed(6.44, in_s=1.84).active()
    assert alert.text == "swing trip: up to 6.4 deg expected in 1.8 s (limit 6.0 deg, clears below 3.0 deg)"


def test_a_peak_that_is_reached_is_now() -> None:
    assert "up to 6.4 deg now" in Site().feed(6.4, in_s=0.04).active().text


def test_the_text_of_a_warning_states_its_own_limit() -> None:
    alert = Site().feed(4.6).active()
    assert alert.text == "swing warn: up to 4.6 deg now (limit 4.0 deg, clears below 3.0 deg)"
    assert (alert.limit_deg, alert.clear_deg) == (4.0, 3.0)


def test_the_text_of_the_lean_states_its_clear_level() -> None:
    alert = Site().feed(1.0, lean_deg=3.5).active("lean")
    assert alert.text == "lean trip: up to 3.5 deg now (limit 3.0 deg, clears below 2.4 deg)"
    assert (alert.limit_deg, alert.clear_deg) == (3.0, 2.4)


def test_each_change_states_every_active_rule() -> None:
    change = Site().feed(1.0).feed(7.0, lean_deg=3.5).changes[-1]
    assert [alert.rule for alert in change.active] == ["swing", "lean"]
    assert change.text == "; ".join(alert.text for alert in change.active)


def test_the_calibration_has_no_clear_level() -> None:
    site = Site()
    readings = {"swing": BELOW, "lean": BELOW}
    changes = list(site.manager.judge(readings, why_unknown="", time_s=1.0, drift_alarm="the norm deviates from 1 g"))
    assert changes[-1].event == "raised"
    assert site.active("calibration").clear_deg is None
    assert site.active("calibration").text == "calibration: the norm deviates from 1 g"


def test_a_suspension_makes_a_trip_unknown_with_a_change_and_the_next_value_decides() -> None:
    site = Site().feed(7.0)
    before = len(site.changes)
    site.changes += site.manager.suspend("SUSPENDED", site.now_s)
    assert site.events[before:] == [("swing", "changed", "unknown"), ("lean", "changed", "unknown")]
    site.feed(3.5)
    assert site.events[before + 2] == ("swing", "changed", "normal")
