"""The state of every gateway follows from its messages, and from nothing else."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from gateway.bus.fleet_inbox import LARGEST_STATE_BYTES, FleetInbox
from gateway.bus.untrusted import MOST_GATEWAYS
from gateway.fleet.fleet_state import DUPLICATE_S, FleetState
from gateway.fleet.gateway_status import GatewayStatus
from gateway.messages import Message
from gateway.topics import TOPIC_OF, encode
from tests.gateway.scene import SAMPLE_TIME_NS, Scene

KEY = "plumbline/v1/north-yard/crane-3/hook"
NOW_UTC = datetime.fromtimestamp(SAMPLE_TIME_NS / 1e9, UTC)


@pytest.fixture
def scene() -> Scene:
    return Scene()


class Fleet:
    """An inbox and the state behind it."""

    def __init__(self, *expected: str) -> None:
        self.inbox = FleetInbox()
        self.state = FleetState(frozenset(expected))

    def hear(self, message: Message, at_s: float, key: str = KEY, *, live: bool = True) -> None:
        self.inbox.put(f"{key}/{TOPIC_OF[type(message)].name}", encode(message), at_s, live=live)

    def hear_all(self, scene: Scene, at_s: float, time_ns: int = SAMPLE_TIME_NS, *, live: bool = True) -> None:
        self.inbox.put_alive(f"{KEY}/alive", True)
        for message in scene.messages(0, time_ns):
            self.hear(message, at_s, live=live)

    def statuses(self, now_s: float) -> dict[str, GatewayStatus]:
        self.state.receive(self.inbox.drain())
        return {status.key: status for status in self.state.statuses(now_s, NOW_UTC)}

    def status(self, now_s: float) -> GatewayStatus:
        return self.statuses(now_s)[KEY]


def test_a_gateway_that_sends_and_is_within_its_limits_is_ok(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    status = fleet.status(10.5)
    assert (status.state, status.level, status.alive, status.seen_s) == ("OK", "normal", True, 0.5)
    assert status.swing is not None
    assert (status.swing.phi_max_deg, status.swing.u_deg) == (2.3, 0.1)
    assert status.motion is not None
    assert (status.motion.predicted_phi_max_deg, status.last_alarm) == (2.3, None)
    assert fleet.state.complete


@pytest.mark.parametrize(("level", "state"), [("warn", "WARN"), ("trip", "TRIP"), ("unknown", "UNKNOWN")])
def test_an_alert_level_is_the_state(scene: Scene, level: Any, state: str) -> None:
    scene.level = level
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    assert (fleet.status(10.5).state, fleet.status(10.5).level) == (state, level)
    assert fleet.status(10.5).last_alarm is None


def test_silence_makes_a_gateway_stale_and_its_level_and_swing_unknown(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    status = fleet.status(20.0)
    assert (status.state, status.level, status.swing, status.seen_s) == ("STALE", "unknown", None, 10.0)
    assert "no new" in status.reasons[0]


def test_messages_that_describe_the_same_sample_again_do_not_look_fresh(scene: Scene) -> None:
    fleet = Fleet()
    for at_s in range(10, 31):
        fleet.hear_all(scene, float(at_s))
        fleet.state.receive(fleet.inbox.drain())
    assert fleet.status(30.0).state == "STALE"


def test_a_gateway_whose_token_is_withdrawn_is_gone(scene: Scene) -> None:
    scene.level = "trip"
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    fleet.inbox.put_alive(f"{KEY}/alive", False)
    status = fleet.status(10.1)
    assert (status.state, status.level, status.swing) == ("GONE", "unknown", None)
    assert status.last_alarm == "TRIP"


def test_an_expected_gateway_that_was_never_seen_is_missing(scene: Scene) -> None:
    other = "plumbline/v1/north-yard/crane-4/hook"
    fleet = Fleet(KEY, other)
    fleet.hear_all(scene, 10.0)
    assert [status.state for status in fleet.statuses(10.0).values()] == ["OK", "MISSING"]
    assert not fleet.state.complete


def test_a_stored_swing_is_as_old_as_the_gateways_own_clock_says(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0, live=False)
    assert fleet.status(10.0).state == "NO DATA"  # how old they are is not known yet
    late = SAMPLE_TIME_NS + 1_000_000_000
    fleet.hear(scene.alert(1, late), 10.2)
    assert fleet.status(10.3).state == "OK"
    fleet.hear(scene.alert(2, SAMPLE_TIME_NS + 60_000_000_000), 10.4)
    assert fleet.status(10.5).state == "STALE"


def test_a_stored_message_never_replaces_a_live_one(scene: Scene) -> None:
    fleet = Fleet()
    scene.level = "trip"
    fleet.hear_all(scene, 10.0)
    scene.level = "normal"
    fleet.hear(scene.alert(0, SAMPLE_TIME_NS - 1), 10.1, live=False)
    assert fleet.status(10.2).level == "trip"
    fleet.hear(scene.alert(0, SAMPLE_TIME_NS - 1), 10.3, live=False)
    assert fleet.status(10.4).level == "trip"


def test_a_gateway_known_from_a_storage_alone_is_gone_and_its_age_is_told(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear(scene.health(0, SAMPLE_TIME_NS - 3600 * 10**9), 10.0, live=False)
    status = fleet.status(10.0)
    assert (status.state, status.seen_s) == ("GONE", 3600.0)


def test_two_gateways_of_one_name_are_noticed(scene: Scene) -> None:
    fleet = Fleet()
    for k in range(4):
        fleet.hear_all(scene, 10.0 + k, SAMPLE_TIME_NS + k)
        fleet.hear(replace(scene.health(k, SAMPLE_TIME_NS + k), boot_id=f"boot-{k % 2}"), 10.0 + k)
        fleet.state.receive(fleet.inbox.drain())
    assert fleet.status(13.5).state == "DUPLICATE"
    for k in range(4, 4 + round(2 * DUPLICATE_S)):
        fleet.hear_all(scene, 10.0 + k, SAMPLE_TIME_NS + k)
        fleet.state.receive(fleet.inbox.drain())
    assert fleet.status(10.0 + 4 + round(2 * DUPLICATE_S) - 1).state == "OK"


def test_a_restart_is_not_taken_for_a_second_gateway(scene: Scene) -> None:
    fleet = Fleet()
    for k, boot_id in enumerate(("first", "first", "second", "second", "second")):
        fleet.hear_all(scene, 10.0 + k, SAMPLE_TIME_NS + k)
        fleet.hear(replace(scene.health(k, SAMPLE_TIME_NS + k), boot_id=boot_id), 10.0 + k)
        fleet.state.receive(fleet.inbox.drain())
    assert fleet.status(14.5).state == "OK"


def test_a_low_battery_is_a_state_of_its_own(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    fleet.hear(replace(scene.health(), battery_low=True, battery_percent=7.0, signal_dbm=-80.0), 10.0)
    status = fleet.status(10.0)
    assert (status.state, status.battery_percent, status.signal_dbm) == ("BATTERY LOW", 7.0, -80.0)


def test_a_part_that_does_not_work_is_a_state_with_its_reason(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    fleet.hear(replace(scene.health(), standing_faults={"recording": "the disk is full"}, battery_low=True), 10.0)
    assert (fleet.status(10.0).state, fleet.status(10.0).reasons) == ("FAULT", ("the disk is full",))
    scene.level = "trip"
    fleet.hear(scene.alert(), 10.1)
    assert fleet.status(10.1).state == "TRIP"


def test_the_causes_of_a_state_are_codes(scene: Scene) -> None:
    scene.level, scene.condition, scene.trusted = "trip", "disturbed", False
    scene.standing_faults = {"recording": "no space left on device"}
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    causes = fleet.status(10.5).causes
    assert [(alert.rule, alert.level, alert.limit_deg) for alert in causes.alerts] == [("swing", "trip", 6.0)]
    assert (causes.failed_gates, causes.faulty_parts) == (("still", "norm_hanging"), ("recording",))
    assert (causes.session, causes.age_s) == ("idle", 0.5)
    scene.condition, scene.trusted = "swinging", True
    fleet.hear_all(scene, 11.0)
    assert fleet.status(11.0).causes.failed_gates == ()


def test_the_age_of_the_calibration_is_that_of_its_record(scene: Scene) -> None:
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    created = (NOW_UTC - timedelta(days=40)).isoformat()
    fleet.hear(replace(scene.calibrated(), record={"created_utc": created}), 10.0)
    assert fleet.status(10.0).calibration_age_days == pytest.approx(40.0)
    fleet.hear(replace(scene.calibrated(), record={"created_utc": "yesterday"}), 10.1)
    assert fleet.status(10.1).calibration_age_days is None


HOSTILE = [
    b"",
    b"\xff\xfe",
    b"null",
    b"[]",
    b"{" * 50_000,
    b"[" * 50_000,
    json.dumps({"schema_version": 2}).encode(),
    b'{"level": "normal", "event": "standing", "active": [], "text": "all well"}',
]


@pytest.mark.parametrize("payload", HOSTILE, ids=[str(payload[:12]) for payload in HOSTILE])
def test_a_payload_that_is_no_message_is_counted_and_changes_nothing(scene: Scene, payload: bytes) -> None:
    scene.level = "trip"
    fleet = Fleet()
    fleet.hear_all(scene, 10.0)
    fleet.state.receive(fleet.inbox.drain())
    fleet.inbox.put(f"{KEY}/alert", payload, 10.1, live=True)
    assert fleet.status(10.2).state == "TRIP"
    assert fleet.state.invalid == 1


@pytest.mark.parametrize(
    "name", ["a/b", "a/b/c/d", "../b/c", "a/b/\x1b[2J", "a/b/c\nd", "a//c", f"{'a' * 300}/b/c", "*/b/c", "a b/c/d"]
)
def test_a_name_that_no_configuration_allows_is_refused(name: str) -> None:
    inbox = FleetInbox()
    inbox.put(f"plumbline/v1/{name}/alert", b"{}", 0.0, live=True)
    inbox.put_alive(f"plumbline/v1/{name}/alive", True)
    assert (inbox.refused, inbox.drain().arrivals) == (2, {})


@pytest.mark.slow
def test_memory_is_bounded_against_large_payloads_and_invented_names() -> None:
    inbox = FleetInbox()
    inbox.put(f"{KEY}/alert", b"x" * (LARGEST_STATE_BYTES + 1), 0.0, live=True)
    for k in range(MOST_GATEWAYS + 10):
        inbox.put(f"plumbline/v1/a/b/{k}/alert", b"{}", 0.0, live=True)
    assert inbox.refused == 11
    assert len(inbox.drain().arrivals) == MOST_GATEWAYS
