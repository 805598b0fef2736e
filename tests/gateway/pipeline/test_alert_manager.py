"""The alert rules of a gateway over a course of readings, what an operator reads of them, and when their validity is sent."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.configuration.model import AlertsSection
from gateway.messages import NO_SESSION, ActiveAlert, Alert
from gateway.pipeline.alert_manager import AlertChange, AlertManager
from gateway.pipeline.alert_rules import ALERT_RULES
from gateway.pipeline.incidents import CHECK_S, Acknowledgement, IncidentRegister
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.stages.alerts import Reading, larger_reading
from tests.gateway.recording.recorded_crane import CLOCK, RecordedCrane

LIMITS = AlertsSection(warn_deg=4.0, trip_deg=6.0, clear_deg=3.0, hold_s=2.0, lean_trip_deg=3.0)
RULES = [rule for rule in ALERT_RULES if rule.name in ("swing", "lean")]
STEP_S = 0.1
BELOW = Reading(math.radians(1.0))


class Site:
    """An alert manager with the changes that it made."""

    def __init__(self) -> None:
        self.register = IncidentRegister("b00t")
        self.manager = AlertManager(LIMITS, self.register, RULES)
        self.changes: list[AlertChange] = []
        self.now_s = 100.0

    def feed(
        self,
        swing_deg: float | None,
        seconds: float = STEP_S,
        *,
        in_s: float = 0.0,
        now_deg: float | None = None,
        lean_deg: float | None = 1.0,
        is_untrusted: bool = False,
    ) -> "Site":
        """Judge the same readings every tenth of a second; `now_deg`: the best estimate of the present angle, +- 0.5 deg."""
        swing = None if swing_deg is None else Reading(math.radians(swing_deg), in_s)
        if swing is not None and now_deg is not None:
            present = Reading(math.radians(now_deg + 0.5), estimate_rad=math.radians(now_deg))
            swing = larger_reading(present, swing)
        lean = None if lean_deg is None else Reading(math.radians(lean_deg))
        for _ in range(round(seconds / STEP_S)):
            readings = {"swing": swing, "lean": lean}
            self.changes += self.manager.judge(
                readings, why_unknown="no angle", time_s=self.now_s, is_untrusted=is_untrusted
            )
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


def test_an_untrusted_time_raises_an_alert_and_states_no_largest_angle() -> None:
    site = Site().feed(1.0).feed(6.5, now_deg=6.2).feed(13.0, now_deg=12.0, is_untrusted=True)
    site.feed(20.0, 3.0, now_deg=19.0, is_untrusted=True).feed(6.5, now_deg=6.1)
    active = site.active()
    assert active.level == "trip"
    assert active.largest_deg == pytest.approx(6.2)
    assert active.largest_upper_deg == pytest.approx(6.7)
    cleared = site.feed(1.0, 10.0).changes[-1]
    assert cleared.event == "cleared"
    assert "largest known angle 6.2 deg" in str(cleared.change)


def test_untrusted_readings_never_lower_a_level_and_start_the_hold_anew() -> None:
    site = Site().feed(7.0).feed(1.0, 30.0, is_untrusted=True)
    assert site.active().level == "trip"
    assert site.active().ends_in_s is None
    site.feed(1.0, 1.9)
    assert site.active().level == "trip"
    site.feed(1.0, 0.3)
    assert site.manager.heartbeat().text == "all normal"


def test_an_alert_clears_from_known_values_alone_whatever_the_motion() -> None:
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
    assert (alert.next_level, alert.next_below_deg, alert.ends_in_s, alert.expected_in_s) == ("warn", 5.4, None, 0.0)


def test_the_text_of_a_coming_peak_states_when_it_comes() -> None:
    alert = Site().feed(6.44, in_s=1.84).active()
    assert alert.expected_in_s == 1.8
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
    assert site.events[before + 2] == ("swing", "cleared", "normal")


def lines(site: Site, event: str) -> list[str]:
    return [change.change or "" for change in site.changes if change.event == event]


def test_an_incident_keeps_its_id_from_raised_to_cleared_and_the_next_one_has_another() -> None:
    site = Site().feed(1.0).feed(4.5, 1.0).feed(7.0, 1.0).feed(3.5, 3.0).feed(2.0, 3.0).feed(7.0)
    course = [(change.event, change.incident) for change in site.changes if change.rule == "swing"]
    assert course == [
        ("changed", None),
        ("raised", "b00t-1"),
        ("raised", "b00t-1"),
        ("changed", "b00t-1"),
        ("cleared", "b00t-1"),
        ("raised", "b00t-2"),
    ]
    assert site.active().incident == "b00t-2"


def test_rules_that_overlap_are_incidents_of_their_own() -> None:
    site = Site().feed(1.0).feed(7.0, lean_deg=3.5)
    assert [change.incident for change in site.changes if change.event == "raised"] == ["b00t-1", "b00t-2"]


def test_a_change_states_the_limit_and_the_clear_level_of_its_rule() -> None:
    site = Site().feed(1.0).feed(4.5).feed(7.0).feed(2.0, 3.0)
    course = [(change.event, change.limit_deg, change.clear_deg) for change in site.changes if change.incident]
    assert course == [("raised", 4.0, 3.0), ("raised", 6.0, 3.0), ("cleared", 6.0, 3.0)]
    assert (site.manager.heartbeat().limit_deg, site.manager.heartbeat().change) == (None, None)


def test_an_incident_survives_the_pipeline_that_a_recalibration_replaces() -> None:
    site = Site().feed(7.0)
    site.manager = AlertManager(LIMITS, site.register, RULES)
    site.feed(1.0)
    assert (site.changes[-2].event, site.changes[-2].incident) == ("cleared", "b00t-1")


def test_a_raise_by_a_coming_peak_says_that_it_is_an_upper_bound() -> None:
    site = Site().feed(1.0).feed(14.2, in_s=1.8, now_deg=4.0)
    assert lines(site, "raised") == [
        "swing raised to trip: up to 14.2 deg expected in 1.8 s, an upper bound, angle now 4.0 deg "
        "(limit 6.0 deg, clears below 3.0 deg) [incident b00t-1]"
    ]
    assert site.active().is_bound is True
    assert site.active().estimate_deg == pytest.approx(14.2)


def test_a_first_bound_that_the_angle_does_not_reach_is_corrected_once() -> None:
    site = Site().feed(1.0).feed(14.2, in_s=1.8, now_deg=4.0).feed(5.6, 1.8 + CHECK_S + 2.0, now_deg=5.1)
    assert [change.event for change in site.changes if change.rule == "swing"] == ["changed", "raised", "corrected"]
    assert lines(site, "corrected") == [
        "swing trip corrected: limit 6.0 deg was not reached: largest angle 5.1 deg, at most 5.6 deg; "
        "the first value was an upper bound [incident b00t-1]"
    ]
    assert site.active().text == (
        "swing trip: up to 5.6 deg now (limit 6.0 deg was not reached: largest angle 5.1 deg, at most 5.6 deg, "
        "clears below 3.0 deg)"
    )
    site.feed(1.0, 3.0, now_deg=0.5)
    assert lines(site, "cleared")[0].startswith("swing cleared after ")
    assert "limit 6.0 deg was not reached: largest angle 5.1 deg, at most 5.6 deg" in lines(site, "cleared")[0]


def test_a_first_bound_that_the_angle_reaches_is_not_corrected() -> None:
    site = Site().feed(1.0).feed(7.2, in_s=1.8, now_deg=4.0).feed(7.0, 1.0, now_deg=6.5).feed(5.0, 10.0, now_deg=4.5)
    assert lines(site, "corrected") == []
    site.feed(1.0, 3.0, now_deg=0.5)
    assert "largest angle 6.5 deg, at most 7.0 deg (limit 6.0 deg)" in lines(site, "cleared")[0]


@pytest.mark.parametrize("upper_deg", [6.0, 6.2])
def test_a_bound_is_not_corrected_while_the_interval_of_the_angle_holds_the_limit(upper_deg: float) -> None:
    site = Site().feed(1.0).feed(14.2, in_s=1.8, now_deg=4.0).feed(upper_deg, 1.0, now_deg=upper_deg - 0.5)
    assert lines(site.feed(5.4, 10.0, now_deg=4.9), "corrected") == []


def test_a_bound_is_not_corrected_where_the_angle_was_not_known_for_a_while() -> None:
    site = Site().feed(1.0).feed(14.2, in_s=1.8, now_deg=4.0).feed(None, 2.0).feed(5.6, 10.0, now_deg=5.1)
    assert lines(site, "corrected") == []
    assert "largest known angle 5.1 deg" in lines(site.feed(1.0, 3.0, now_deg=0.5), "cleared")[0]


def test_a_measured_angle_above_the_limit_is_no_bound() -> None:
    site = Site().feed(1.0).feed(7.0, now_deg=6.5)
    assert "upper bound" not in lines(site, "raised")[0]
    assert site.active().is_bound is False


def test_the_end_of_a_drift_alarm_is_a_cleared_incident_without_an_angle() -> None:
    site = Site()
    readings = {"swing": BELOW, "lean": BELOW}
    list(site.manager.judge(readings, why_unknown="", time_s=1.0, drift_alarm="the norm deviates from 1 g"))
    (cleared,) = site.manager.judge(readings, why_unknown="", time_s=9.0)
    assert (cleared.event, cleared.incident, cleared.limit_deg) == ("cleared", "b00t-1", None)
    assert cleared.change == "calibration cleared after 8.0 s: the cause has ended [incident b00t-1]"


def test_the_largest_angle_of_a_standing_alert_holds_no_coming_peak() -> None:
    site = Site().feed(1.0).feed(14.2, 1.0, in_s=1.8, now_deg=4.0)
    assert site.active().largest_deg == pytest.approx(4.0)
    assert site.active().largest_upper_deg == pytest.approx(4.5)


def acknowledge(site: Site, incident: str = "b00t-1") -> AlertChange | None:
    return site.manager.acknowledge(Acknowledgement(incident, "ann", "load set down"), round(site.now_s * 1e9))


def test_an_acknowledgement_is_a_change_that_leaves_the_level() -> None:
    site = Site().feed(1.0).feed(7.0)
    change = acknowledge(site)
    assert change is not None
    assert (change.rule, change.event, change.level, change.incident) == ("swing", "acknowledged", "trip", "b00t-1")
    assert change.change == "swing acknowledged by ann: load set down [incident b00t-1]"
    assert (change.acknowledged_by, change.reason, change.limit_deg) == ("ann", "load set down", 6.0)
    (active,) = change.active
    assert (active.acknowledged_by, active.acknowledged_ns) == ("ann", round(site.now_s * 1e9))


def test_an_incident_is_acknowledged_once_until_it_rises_to_a_higher_level() -> None:
    site = Site().feed(1.0).feed(5.0)
    assert acknowledge(site) is not None
    assert acknowledge(site) is None
    site.feed(7.0)
    assert site.active().acknowledged_by is None
    assert acknowledge(site) is not None


def test_an_incident_that_has_ended_can_still_be_acknowledged() -> None:
    site = Site().feed(1.0).feed(7.0).feed(1.0, 3.0)
    assert list(site.register.unacknowledged()) == ["b00t-1"]
    change = acknowledge(site)
    assert change is not None
    assert (change.level, change.active) == ("normal", [])
    assert list(site.register.unacknowledged()) == []


def test_an_incident_of_an_earlier_pipeline_can_be_acknowledged() -> None:
    site = Site().feed(1.0).feed(7.0)
    site.manager = AlertManager(LIMITS, site.register, RULES)
    change = acknowledge(site)
    assert change is not None
    assert (change.rule, change.clear_deg) == ("swing", 3.0)


def test_an_unknown_incident_is_not_acknowledged() -> None:
    assert acknowledge(Site().feed(1.0)) is None


STALE_NS = 1_100_000_000


class HearingCrane(RecordedCrane):
    """Keeps the alert messages."""

    def __init__(self, folder: Path) -> None:
        self.heard: list[tuple[int, Alert]] = []
        super().__init__(folder)

    def write(self, message: OutgoingMessage) -> None:
        if isinstance(message.message, Alert):
            self.heard.append((message.log_time_ns, message.message))

    def validities(self, since: int = 0) -> list[str | None]:
        return [message.validity for _, message in self.heard[since:]]


@pytest.fixture
def crane(tmp_path: Path) -> HearingCrane:
    crane = HearingCrane(tmp_path)
    crane.record(12)
    assert crane.validities()[-1] == "valid"
    return crane


@pytest.mark.slow
def test_the_end_and_the_return_of_samples_do_not_wait_for_a_heartbeat(crane: HearingCrane) -> None:
    before = len(crane.heard)
    silent_ns = crane.newest_ns + STALE_NS
    for message in crane.pipeline.idle(silent_ns, CLOCK).messages:
        crane.write(message)
    assert (silent_ns, "no_samples") == (crane.heard[before][0], crane.heard[before][1].validity)
    before = len(crane.heard)
    crane.record(0.1)
    assert crane.validities(before)[0] != "no_samples"


@pytest.mark.slow
def test_a_housing_off_the_rope_suspends_at_once(crane: HearingCrane) -> None:
    before = len(crane.heard)
    crane.pipeline.set_session(replace(NO_SESSION, id="r-1", suspended=True))
    crane.record(0.1)
    assert crane.validities(before)[:1] == ["suspended"]


def test_before_the_first_sample_nothing_is_known(tmp_path: Path) -> None:
    crane = HearingCrane(tmp_path)
    for message in crane.pipeline.idle(crane.newest_ns, CLOCK).messages:
        crane.write(message)
    assert crane.validities() == ["no_samples"]
