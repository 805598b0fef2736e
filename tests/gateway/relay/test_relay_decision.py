"""The relay is energised only while every level is known and below the one at which it drops."""

from dataclasses import replace
from typing import Any

import pytest

from gateway.configuration.relay_section import CommandRelay
from gateway.daemon.outputs.relay_worker import RelayLogic
from gateway.messages import ActiveAlert, Alert, Level

UNKNOWN_S = 5.0


def settings(**changes: Any) -> CommandRelay:
    return CommandRelay(kind="command", command=["relay"], **{"unknown_s": UNKNOWN_S, **changes})


def active(level: Level, rule: str = "swing", value_deg: float | None = 7.0, by: str | None = None) -> ActiveAlert:
    return ActiveAlert(
        rule=rule, level=level, since_ns=0, value_deg=value_deg, acknowledged_by=by, text=f"{rule} {level}"
    )


def alert(*alerts: ActiveAlert) -> Alert:
    rank: list[Level] = ["normal", "unknown", "warn", "trip"]
    level = rank[max((rank.index(each.level) for each in alerts), default=0)]
    return Alert(
        time_ns=0,
        clock="synchronised",
        sequence=0,
        level=level,
        validity="valid",
        event="standing",
        active=[*alerts],
        text="text",
    )


NORMAL = alert()


def logic(**changes: Any) -> RelayLogic:
    """One that has seen a known level."""
    known = RelayLogic(settings(**changes))
    assert known.judge(NORMAL, 0.0).energised
    return known


def test_the_relay_stays_released_until_a_level_is_known() -> None:
    relay = RelayLogic(settings())
    assert not relay.judge(alert(active("unknown")), 0.0).energised
    assert not relay.judge(alert(active("unknown")), 1.0).energised
    assert relay.judge(NORMAL, 2.0).energised


@pytest.mark.parametrize(("drop_at", "level", "energised"), [
    ("trip", "trip", False), ("trip", "warn", True), ("warn", "warn", False), ("warn", "trip", False),
])  # fmt: skip
def test_the_configured_level_drops_the_relay(drop_at: str, level: Level, energised: bool) -> None:
    decision = logic(drop_at=drop_at).judge(alert(active(level)), 1.0)
    assert decision.energised is energised
    assert decision.reason == ("" if energised else f"swing {level}")


def test_a_trip_drops_the_relay_while_its_value_is_not_known() -> None:
    assert not logic().judge(alert(active("trip", value_deg=None)), 1.0).energised


def test_an_unknown_level_drops_the_relay_after_its_time_and_a_known_one_brings_it_back() -> None:
    relay = logic()
    unknown = alert(active("unknown", value_deg=None))
    assert relay.judge(unknown, UNKNOWN_S).energised
    decision = relay.judge(unknown, UNKNOWN_S + 0.1)
    assert not decision.energised
    assert decision.reason.startswith("not known for more than 5 s")
    assert relay.judge(NORMAL, UNKNOWN_S + 1.0).energised


def test_a_warning_without_a_known_value_counts_as_unknown() -> None:
    relay = logic()
    assert relay.judge(alert(active("warn", value_deg=None)), 1.0).energised
    assert not relay.judge(alert(active("warn", value_deg=None)), UNKNOWN_S + 1.1).energised


def test_a_warning_does_not_hide_that_another_rule_is_unknown() -> None:
    relay = logic()
    both = alert(active("warn"), active("unknown", "lean", None))
    assert not relay.judge(both, UNKNOWN_S + 0.1).energised


def test_a_warning_of_the_calibration_has_no_value_and_is_not_unknown() -> None:
    assert logic().judge(alert(active("warn", "calibration", None)), UNKNOWN_S + 1.0).energised


@pytest.mark.parametrize("validity", ["no_samples", "suspended", "uncalibrated", "not_known"])
def test_a_normal_level_that_is_not_valid_counts_as_unknown(validity: Any) -> None:
    relay = logic()
    assert relay.judge(replace(NORMAL, validity=validity), UNKNOWN_S).energised
    assert not relay.judge(replace(NORMAL, validity=validity), UNKNOWN_S + 0.1).energised
    assert relay.judge(replace(NORMAL, validity="valid"), UNKNOWN_S + 0.2).energised


def test_an_acknowledged_incident_holds_the_relay_dropped_unless_it_drives_a_horn() -> None:
    acknowledged = alert(active("trip", by="ann"))
    assert not logic().judge(acknowledged, 1.0).energised
    horn = logic(ignore_acknowledged=True)
    assert horn.judge(acknowledged, 1.0).energised
    assert not horn.judge(alert(active("trip", by="ann"), active("trip", "lean")), 1.0).energised


def test_a_level_without_an_entry_of_its_rule_drops_the_relay() -> None:
    trip = Alert(time_ns=0, clock="synchronised", sequence=0, level="trip", event="standing", active=[], text="?")
    assert not logic().judge(trip, 1.0).energised
