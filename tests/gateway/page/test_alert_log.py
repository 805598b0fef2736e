"""The list of alerts of the shift: begun, raised, ended, bounded."""

from dataclasses import replace
from typing import Any

import pytest

from gateway.alert_periods import MAX_ENDED_INCIDENTS, SHIFT_NS
from gateway.messages import ActiveAlert, Alert, Level
from gateway.page.history import MAX_LISTED_ALERTS, AlertLog

SECOND_NS = 10**9
LIMITS_DEG: dict[Level, float] = {"warn": 4.0, "trip": 6.0}


def _message(time_s: float, *active: tuple[str, Level, float | None], since_s: float = 0.0) -> Alert:
    header: dict[str, Any] = {"clock": "synchronised", "sequence": 0, "calibration_id": None}
    since_ns = round(since_s * 1e9)
    alerts = [
        ActiveAlert(
            rule=rule,
            level=level,
            since_ns=since_ns,
            value_deg=None if value_deg is None else value_deg + 1.5,  # a coming peak, which the list does not show
            largest_deg=value_deg,
            limit_deg=LIMITS_DEG.get(level),
            text="",
        )
        for rule, level, value_deg in active
    ]
    return Alert(
        time_ns=round(time_s * 1e9), **header, level="normal", event="standing", rule=None, active=alerts, text=""
    )


def _standing(time_s: float, level: Level, incident: str, by: str | None = None, event: Any = "standing") -> Alert:
    message = _message(time_s, ("swing", level, 6.5))
    acknowledged_ns = None if by is None else round(time_s * 1e9)
    active = [replace(message.active[0], incident=incident, acknowledged_by=by, acknowledged_ns=acknowledged_ns)]
    return replace(message, active=active, event=event, incident=incident, acknowledged_by=by)


@pytest.fixture
def log() -> AlertLog:
    return AlertLog()


def test_a_warning_that_becomes_a_trip_is_one_alert_at_its_highest_level(log: AlertLog) -> None:
    log.add(_message(10, ("swing", "warn", 4.5), since_s=9))
    log.add(_message(12, ("swing", "trip", 6.5), since_s=12))
    log.add(_message(15, ("swing", "trip", 7.5), since_s=12))
    log.add(_message(20, ("swing", "warn", 4.2), since_s=20))
    log.add(_message(25))
    (only,) = log.alerts()
    assert (only.level, only.largest_deg, only.limit_deg) == ("trip", 7.5, 6.0)
    assert (only.since_ns, only.until_ns) == (9 * SECOND_NS, 25 * SECOND_NS)


def test_two_rules_are_two_alerts(log: AlertLog) -> None:
    log.add(_message(1, ("swing", "warn", 4.5), ("lean", "trip", 6.2)))
    log.add(_message(2, ("lean", "trip", 6.3)))
    assert [(alert.rule, alert.until_ns is None) for alert in log.alerts()] == [("swing", False), ("lean", True)]


def test_an_alert_whose_value_becomes_unknown_stays_active(log: AlertLog) -> None:
    log.add(_standing(1, "trip", "b-1"))
    log.add(_standing(2, "unknown", "b-1"))
    (only,) = log.alerts()
    assert (only.level, only.largest_deg, only.until_ns) == ("trip", 6.5, None)


def test_an_unknown_level_alone_is_no_alert(log: AlertLog) -> None:
    log.add(_message(1, ("swing", "unknown", None)))
    assert log.alerts() == []
    assert log.since_ns == SECOND_NS


def test_the_list_and_its_incidents_outlive_a_start_of_the_gateway(log: AlertLog) -> None:
    log.add(replace(_standing(10, "trip", "first-1"), boot_id="first", alert_number=1))
    log.add(replace(_message(70), boot_id="second", alert_number=1))
    (only,) = log.alerts()
    assert (only.level, only.incident, only.until_ns) == ("trip", "first-1", 70 * SECOND_NS)
    assert log.alerts()[0].is_cut  # a larger angle may have come, which nobody stated
    log.add(replace(_standing(80, "trip", "second-1"), boot_id="second", alert_number=2))
    assert [alert.incident for alert in log.alerts()] == ["first-1", "second-1"]


def test_only_what_the_gateway_still_knows_can_be_acknowledged(log: AlertLog) -> None:
    count = MAX_ENDED_INCIDENTS + 2
    for i in range(count):
        log.add(_standing(2 * i, "trip", f"b-{i}"))
        log.add(_message(2 * i + 1))
    log.add(_standing(2 * count, "trip", "b-last"))
    incidents = [alert.incident for alert in log.alerts()]
    assert incidents == [None, None, *(f"b-{i}" for i in range(2, count)), "b-last"]


def test_a_change_that_comes_again_after_later_ones_begins_nothing(log: AlertLog) -> None:
    raised = replace(_standing(10, "trip", "boot-1"), boot_id="boot", alert_number=1)
    log.add(raised)
    log.add(replace(_message(20), boot_id="boot", alert_number=2))
    log.add(raised)
    (only,) = log.alerts()
    assert only.until_ns == 20 * SECOND_NS


def test_the_list_begins_with_its_first_alert_or_the_start_or_the_shift(log: AlertLog) -> None:
    assert AlertLog().since_ns is None
    log.add(replace(_message(10, ("swing", "trip", 6.5), since_s=9), boot_id="first"))
    assert log.since_ns == 9 * SECOND_NS
    log.add(replace(_message(3600), boot_id="second"))
    assert log.since_ns == 9 * SECOND_NS
    shift_s = SHIFT_NS / 1e9
    log.add(replace(_message(3599 + shift_s), boot_id="second"))
    assert log.since_ns == 3599 * SECOND_NS
    log.add(replace(_message(3601 + shift_s), boot_id="second"))  # the alert has left the list
    assert (log.alerts(), log.since_ns) == ([], 3601 * SECOND_NS)


def test_number_and_age_are_bounded(log: AlertLog) -> None:
    for i in range(2 * MAX_LISTED_ALERTS):
        log.add(_message(2 * i, ("swing", "warn", 4.5), since_s=2 * i))
        log.add(_message(2 * i + 1))
    assert len(log.alerts()) == MAX_LISTED_ALERTS
    log.add(_message(4 * MAX_LISTED_ALERTS + SHIFT_NS / 1e9))
    assert log.alerts() == []


def test_an_acknowledgement_ends_with_a_higher_level(log: AlertLog) -> None:
    log.add(_standing(1, "warn", "b-1"))
    log.add(_standing(2, "warn", "b-1", by="Ann", event="acknowledged"))
    (only,) = log.alerts()
    assert (only.acknowledged_by, only.acknowledged_ns) == ("Ann", 2 * SECOND_NS)
    log.add(_standing(3, "trip", "b-1"))
    assert log.alerts()[0].acknowledged_by is None


def test_an_alert_can_be_acknowledged_after_its_end(log: AlertLog) -> None:
    log.add(_standing(1, "trip", "b-1"))
    log.add(_message(2))
    log.add(replace(_message(5), event="acknowledged", incident="b-1", acknowledged_by="Ann"))
    (only,) = log.alerts()
    assert (only.until_ns, only.acknowledged_by, only.acknowledged_ns) == (2 * SECOND_NS, "Ann", 5 * SECOND_NS)


def test_another_incident_of_the_same_rule_is_another_alert(log: AlertLog) -> None:
    log.add(_standing(1, "trip", "b-1"))
    log.add(_standing(9, "trip", "b-2"))
    assert [(alert.incident, alert.until_ns) for alert in log.alerts()] == [("b-1", 9 * SECOND_NS), ("b-2", None)]
