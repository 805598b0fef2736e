"""What a bridge knows of its gateway: a value is stated while it holds, and never after; OPC UA has a bad status for it then."""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import pytest
from asyncua import ua

from gateway.bridge.opcua_values import data_value
from gateway.bridge.plant_snapshot import (
    LEVEL_CODES,
    LONGEST_AGE_MS,
    SOURCE_CODES,
    STATE_CODES,
    PlantSnapshot,
    PlantState,
)
from gateway.bridge.plant_values import PLANT_VALUES
from gateway.bus.authenticity import Doubt
from gateway.messages import Level, Validity
from tests.gateway.bridge.conftest import KEY, Listener
from tests.gateway.scene import SAMPLE_TIME_NS

MEASURED = (
    "angle_deg",
    "angle_u95_deg",
    "phi_max_deg",
    "phi_max_u95_deg",
    "peak_deg",
    "peak_u95_deg",
    "time_to_peak_s",
)


def measured(snapshot: PlantSnapshot) -> list[float | None]:
    return [getattr(snapshot, name) for name in MEASURED]


def test_all_values_are_stated_while_they_are_known(listener: Listener) -> None:
    listener.changes["health"] = {"battery_percent": 64.0, "battery_v": 3.61}
    listener.changes["calibration"] = {"record": {"created_utc": "2025-10-04T08:53:20Z"}}
    listener.hear(10.0)
    snapshot = listener.snapshot(10.2)
    assert snapshot.state is PlantState.FINE
    assert measured(snapshot) == pytest.approx([1.15, 0.196, 2.3, 0.196, 2.3, 0.196, 1.7], rel=1e-3)
    assert (snapshot.level, snapshot.active_alerts, snapshot.alert_number, snapshot.boot_id) == ("normal", 0, 7, "b00t")
    assert (snapshot.source, snapshot.battery_percent, snapshot.battery_v) == ("sensor", 64.0, 3.61)
    assert snapshot.calibration_age_days == pytest.approx(5.0)
    assert snapshot.age_ms == 199
    assert snapshot.sample_time_ns == SAMPLE_TIME_NS + 10**10


def test_the_expected_peak_is_halfway_between_both_predictions_as_in_the_alerts(listener: Listener) -> None:
    listener.changes["motion"] = {"predicted_phi_max_deg": 4.0, "time_to_peak_s": 1.1, "coasting_time_to_peak_s": 1.9}
    listener.hear(10.0)
    snapshot = listener.snapshot(10.0)
    assert snapshot.peak_deg == pytest.approx((4.0 + 2.3) / 2)
    assert snapshot.time_to_peak_s == 1.1


def break_link(listener: Listener) -> None:
    listener.linked = False


def lose_token(listener: Listener) -> None:
    listener.inbox.put_alive(f"{KEY}/alive", False)


def hear_without(*topics: str) -> Any:
    wanted = tuple(topic for topic in ("motion", "alert", "health") if topic not in topics)

    def hear(listener: Listener) -> None:
        for step in range(11, 31):
            listener.hear(step / 10 + 10, wanted)

    return hear


def say(topic: str, **changes: Any) -> Any:
    def change(listener: Listener) -> None:
        listener.changes.setdefault(topic, {}).update(changes)
        listener.hear(12.9)

    return change


def lose_samples(listener: Listener) -> None:
    listener.changes["alert"]["validity"] = "no_samples"
    listener.changes["motion"] = {"state": "unknown", "angle_deg": None, "reason_codes": ["no_samples"]}
    for step in range(6):
        listener.hear(10.5 + step / 2)


def repeat_the_sample(listener: Listener) -> None:
    for step in range(11, 31):
        listener.hear(step / 10 + 10, ("alert", "health"))
        listener.changes["motion"] = {"time_ns": SAMPLE_TIME_NS + 10**10}
        listener.hear(step / 10 + 10, ("motion",))


@pytest.mark.parametrize(
    ("event", "state"),
    [
        (break_link, PlantState.LINK_GONE),
        (lose_token, PlantState.GATEWAY_GONE),
        (lambda _: None, PlantState.GATEWAY_GONE),
        (hear_without("motion"), PlantState.STALE),
        (hear_without("alert"), PlantState.NOT_KNOWN),
        (hear_without("motion", "alert"), PlantState.STALE),
        (hear_without("motion", "health"), PlantState.STALE),
        (lose_samples, PlantState.SENSOR_GONE),
        (repeat_the_sample, PlantState.STALE),
        (say("alert", validity="no_samples"), PlantState.SENSOR_GONE),
        (say("alert", validity="uncalibrated"), PlantState.UNCALIBRATED),
        (say("alert", validity="suspended"), PlantState.SUSPENDED),
        (say("alert", validity="not_known"), PlantState.NOT_KNOWN),
        (say("alert", boot_id="another"), PlantState.NO_DATA),
        (say("motion", angle_deg=None), PlantState.NOT_KNOWN),
        (say("health", device_kind="simulated"), PlantState.SIMULATED),
        (say("health", device_kind="replay"), PlantState.REPLAY),
        (say("alert", clock="replayed"), PlantState.REPLAY),
        (say("health", standing_faults={"identity": "twice"}), PlantState.DUPLICATE),
    ],
)
def test_nothing_measured_is_stated_and_nothing_is_calm_when_it_is_not_known(event: Any, state: PlantState) -> None:
    listener = Listener()
    listener.hear(10.0)
    assert listener.snapshot(10.1).angle_deg is not None
    event(listener)
    snapshot = listener.snapshot(13.0)
    assert snapshot.state is state
    assert measured(snapshot) == [None] * len(MEASURED)
    assert snapshot.level == "unknown"
    assert listener.snapshot(13.1).heartbeat == snapshot.heartbeat


UNSIGNED, WRONG = Doubt("unsigned", "it is not signed"), Doubt("wrong", "its signature is wrong")


@pytest.mark.parametrize(("doubt", "allow_unsigned"), [(UNSIGNED, False), (WRONG, False), (WRONG, True)])
def test_what_is_not_signed_is_no_number(doubt: Doubt, allow_unsigned: bool) -> None:
    listener = Listener(allow_unsigned=allow_unsigned)
    listener.hear(10.0, doubt=doubt)
    snapshot = listener.snapshot(10.1)
    assert snapshot.state is PlantState.NOT_AUTHENTICATED
    assert measured(snapshot) == [None] * len(MEASURED)
    assert (snapshot.level, snapshot.heartbeat, snapshot.source) == ("unknown", 0, "unknown")


def test_a_gateway_without_a_key_has_values_where_that_is_allowed() -> None:
    listener = Listener(allow_unsigned=True)
    listener.hear(10.0, doubt=UNSIGNED)
    assert listener.snapshot(10.1).angle_deg is not None


def test_forged_messages_beside_authentic_ones_change_nothing() -> None:
    listener = Listener(allow_unsigned=True)
    listener.hear(10.0, doubt=UNSIGNED)
    listener.hear(11.0)
    listener.changes["motion"] = {"angle_deg": 0.0}
    listener.changes["alert"] |= {"validity": "suspended"}
    listener.hear(11.2, doubt=UNSIGNED)
    snapshot = listener.snapshot(11.3)
    assert snapshot.state is PlantState.FINE
    assert snapshot.angle_deg == pytest.approx(1.15)
    listener.hear(15.0, doubt=WRONG)
    assert listener.snapshot(15.1).state is PlantState.NOT_AUTHENTICATED


@pytest.mark.parametrize("validity", ["no_samples", "not_known"])
def test_an_alarm_stands_while_the_gateway_says_so_though_it_cannot_see_its_end(validity: Validity) -> None:
    listener = Listener()
    listener.scene.level = "trip"
    listener.changes["alert"]["validity"] = validity
    listener.hear(10.0)
    assert listener.snapshot(10.1).level == "trip"
    assert listener.snapshot(10.1).active_alerts == 1
    assert listener.snapshot(12.0).level == "unknown"
    assert listener.snapshot(12.0).active_alerts is None


def test_the_heartbeat_counts_valid_readings_alone(listener: Listener) -> None:
    for step in range(5):
        listener.hear(10.0 + step / 10)
    assert listener.snapshot(10.5).heartbeat == 5
    listener.changes["alert"]["validity"] = "uncalibrated"
    for step in range(5):
        listener.hear(11.0 + step / 10)
    assert listener.snapshot(11.5).heartbeat == 5


def test_a_demonstration_states_the_values_and_their_source() -> None:
    listener = Listener(demonstration=True)
    listener.scene.device_kind = "simulated"
    listener.hear(10.0)
    snapshot = listener.snapshot(10.1)
    assert (snapshot.state, snapshot.source) == (PlantState.FINE, "simulated")
    assert snapshot.angle_deg == pytest.approx(1.15)


def test_the_calibration_of_before_a_cut_or_a_restart_is_not_taken_for_the_present_one(listener: Listener) -> None:
    def age_after(cut: Callable[[float], None], at_s: float) -> float | None:
        listener.changes["calibration"] = {"record": {"created_utc": "2025-10-04T08:53:20Z"}}
        listener.hear(at_s)
        cut(at_s + 1)
        listener.hear(at_s + 2, ("motion", "alert", "health"))
        assert listener.snapshot(at_s + 2).calibration_age_days is None
        listener.changes["calibration"] = {"record": {"created_utc": "2025-10-08T08:53:20Z"}}  # made meanwhile
        listener.hear(at_s + 2, ("calibration",), live=False)
        return listener.snapshot(at_s + 2).calibration_age_days

    def lose_link(at_s: float) -> None:
        listener.linked = False
        listener.take(at_s)
        listener.linked = True

    def restart(at_s: float) -> None:
        listener.inbox.put_alive(f"{KEY}/alive", False)
        listener.take(at_s)

    for number, cut in enumerate((lose_link, restart)):
        assert age_after(cut, 10.0 * number) == pytest.approx(1.0)


def test_stored_messages_prove_nothing_but_the_calibration(listener: Listener) -> None:
    listener.changes["calibration"] = {"record": {"created_utc": "2025-10-04T08:53:20Z"}}
    listener.hear(10.0, live=False)
    snapshot = listener.snapshot(10.1)
    assert snapshot.state is PlantState.NO_DATA
    assert (snapshot.age_s, snapshot.sample_time_ns) == (None, None)
    listener.hear(10.1, ("motion", "alert", "health"))
    snapshot = listener.snapshot(10.1)
    assert snapshot.state is PlantState.FINE
    assert snapshot.calibration_age_days == pytest.approx(5.0)


def test_age_and_time_are_those_of_the_newest_sample_while_the_sensor_is_gone(listener: Listener) -> None:
    listener.hear(10.0)
    lose_samples(listener)
    snapshot = listener.snapshot(13.5)
    assert (snapshot.age_ms, snapshot.sample_time_ns) == (3500, SAMPLE_TIME_NS + 10**10)


def test_a_gateway_that_was_never_heard_has_not_stopped(listener: Listener) -> None:
    listener.take(0.0)
    assert listener.snapshot(20.0).state is PlantState.NO_DATA
    listener.hear(20.0, ("health",))
    assert listener.snapshot(20.1).state is PlantState.STALE  # its sensor was never there: it has no alerts
    assert listener.snapshot(30.0).state is PlantState.GATEWAY_GONE


@pytest.mark.parametrize(("level", "count"), [("normal", 0), ("unknown", None), ("warn", 1), ("trip", 1)])
def test_a_rule_that_is_not_known_is_no_active_alert(listener: Listener, level: Level, count: int | None) -> None:
    listener.scene.level = level
    listener.hear(10.0)
    assert listener.snapshot(10.1).active_alerts == count


def test_the_age_grows_to_its_largest(listener: Listener) -> None:
    listener.hear(10.0)
    assert listener.snapshot(14.0).age_ms == 4000
    assert listener.snapshot(1e6).age_ms == LONGEST_AGE_MS


def test_garbage_is_counted_and_changes_nothing(listener: Listener) -> None:
    listener.hear(10.0)
    for topic in ("motion", "alert", "health"):
        listener.inbox.put(f"{KEY}/{topic}", b"{]", 10.1, live=True)
    assert listener.snapshot(10.1).state is PlantState.FINE
    assert listener.heard.invalid == 3


@pytest.mark.parametrize("level", ["normal", "warn", "trip", "unknown"])
def test_every_level_has_its_number(listener: Listener, level: Level) -> None:
    listener.scene.level = level
    listener.hear(10.0)
    value = next(value for value in PLANT_VALUES if value.name == "level")
    assert value.number(listener.snapshot(10.0)) == LEVEL_CODES[level].number


def test_numbers_that_are_no_longer_known_are_out_of_every_promised_range() -> None:
    known = PlantSnapshot(state=PlantState.FINE, angle_deg=181.0, battery_v=-1.0)
    numbers = {value.name: value.number(known) for value in PLANT_VALUES}
    assert numbers["angle_deg"] is None
    assert numbers["battery_v"] is None


def test_the_table_names_what_a_snapshot_has_and_each_once() -> None:
    names = [value.name for value in PLANT_VALUES]
    derived = {"age_s", "sample_time_ns", "boot_id"}
    assert sorted(names) == sorted(
        {each.name for each in fields(PlantSnapshot)} - derived | {"schema_version", "age_ms", "boot"}
    )
    for codes in (STATE_CODES, LEVEL_CODES, SOURCE_CODES):
        assert [code.number for code in codes.values()] == list(range(len(codes)))
    assert set(STATE_CODES) == set(PlantState)


def test_a_clock_that_is_out_of_range_costs_the_sample_time_alone() -> None:
    snapshot = replace(PlantSnapshot(state=PlantState.FINE), sample_time_ns=10**30)
    assert snapshot.sample_time is None


@pytest.mark.parametrize("state", PlantState)
def test_what_is_not_known_is_bad_in_every_state(state: PlantState) -> None:
    snapshot = PlantSnapshot(state=state)
    for value in PLANT_VALUES:
        if value.number(snapshot) is None:
            shown = data_value(value, snapshot)
            assert shown.StatusCode is not None
            assert shown.StatusCode.is_bad()
            assert shown.Value == ua.Variant()
