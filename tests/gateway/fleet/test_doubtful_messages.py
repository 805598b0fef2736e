"""A card is calm only by authentic messages: doubtful ones change nothing of what a gateway says, and are told."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.bus.authenticity import DOUBT_S, OLD, UNSIGNED, Doubt
from gateway.bus.fleet_inbox import FleetInbox
from gateway.fleet.fleet_servers import _card, format_fleet
from gateway.fleet.fleet_state import FleetState
from gateway.fleet.gateway_status import GatewayStatus
from gateway.messages import Level
from gateway.topics import TOPIC_OF, encode
from tests.gateway.fleet.test_fleet_state import KEY, NOW_UTC
from tests.gateway.scene import SAMPLE_TIME_NS, Scene

FORGED = Doubt("wrong", "its signature is wrong")
STRANGER = Doubt("unknown", "nobody here knows the key")
DOUBTS = FORGED, STRANGER, UNSIGNED
PROOFS = *DOUBTS, OLD, None


class Fleet:
    """An inbox and the state behind it."""

    def __init__(self) -> None:
        self.inbox = FleetInbox()
        self.state = FleetState()
        self.inbox.put_alive(f"{KEY}/alive", True)

    def hear(self, level: Level, at_s: float, doubt: Doubt | None = None, *, live: bool = True) -> None:
        scene = Scene()
        scene.level = level
        for message in scene.messages(0, SAMPLE_TIME_NS + round(at_s * 1e9)):
            name = f"{KEY}/{TOPIC_OF[type(message)].name}"
            self.inbox.put(name, encode(message), at_s, live=live, doubt=doubt)

    def status(self, now_s: float) -> GatewayStatus:
        self.state.receive(self.inbox.drain())
        (status,) = self.state.statuses(now_s, NOW_UTC)
        return status


@pytest.mark.parametrize("doubt", DOUBTS)
def test_without_authentic_messages_a_card_is_never_calm_and_an_alarm_is_marked(doubt: Doubt) -> None:
    fleet = Fleet()
    fleet.hear("normal", 10.0, doubt)
    status = fleet.status(10.5)
    assert (status.state, status.level, status.swing) == ("NOT AUTHENTICATED", "unknown", None)
    assert doubt.text in status.reasons[0]
    fleet.hear("trip", 11.0, doubt)
    status = fleet.status(11.5)
    assert (status.state, status.level, status.swing, status.authenticated) == ("TRIP", "trip", None, False)
    assert status.label == "LIMIT NOT AUTHENTICATED"
    assert _card(status)["authenticated"] is False


@pytest.mark.parametrize("doubt", DOUBTS)
def test_a_forged_calm_neither_ends_an_alarm_nor_counts_as_a_heartbeat(doubt: Doubt) -> None:
    fleet = Fleet()
    fleet.hear("trip", 10.0)
    fleet.status(10.0)
    for at_s in (10.2, 15.0):
        fleet.hear("normal", at_s, doubt)
    assert (fleet.status(10.5).state, fleet.status(10.5).level) == ("TRIP", "trip")
    assert not fleet.status(15.0).authenticated
    assert fleet.status(15.0).state == "STALE"


def test_who_sends_beside_a_gateway_takes_its_calm_for_a_time_and_not_longer() -> None:
    fleet = Fleet()
    fleet.hear("normal", 10.0)
    assert fleet.status(10.0).state == "OK"
    fleet.hear("normal", 10.1, FORGED)
    assert fleet.status(10.2).state == "NOT AUTHENTICATED"
    fleet.hear("normal", 10.1 + DOUBT_S + 0.1)
    assert fleet.status(10.1 + DOUBT_S + 0.2).state == "OK"


def test_the_first_authentic_message_takes_the_place_of_all_that_was_doubtful() -> None:
    fleet = Fleet()
    fleet.hear("trip", 10.0, STRANGER)
    assert fleet.status(10.1).state == "TRIP"
    fleet.hear("normal", 30.0)
    assert (fleet.status(30.1).state, fleet.status(30.1).authenticated) == ("OK", True)


def test_messages_that_come_again_are_no_heartbeat_and_no_finding() -> None:
    fleet = Fleet()
    fleet.hear("normal", 10.0)
    fleet.status(10.0)
    fleet.hear("normal", 14.0, OLD)
    assert fleet.status(10.5).state == "OK"
    assert fleet.status(14.5).state == "STALE"


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(st.sampled_from(PROOFS), st.sampled_from(("normal", "trip")), st.booleans(), st.booleans()),
        max_size=6,
    )
)
def test_whatever_comes_in_whatever_order_a_card_is_calm_by_authentic_messages_alone(
    sent: list[tuple[Doubt | None, Level, bool, bool]],
) -> None:
    fleet = Fleet()
    authentic: Level | None = None
    for number, (doubt, level, live, is_looked_at) in enumerate(sent):
        fleet.hear(level, 10.0 + number / 10, doubt, live=live)
        if doubt is None and live:
            authentic = level
        if is_looked_at:
            fleet.status(10.0 + number / 10)
    if not sent:
        return
    status = fleet.status(11.0)
    if status.state == "OK":
        assert authentic == "normal"
        assert not any(doubt in DOUBTS for doubt, *_ in sent)
    if authentic == "trip":
        assert (status.state, status.level) == ("TRIP", "trip")


def test_metrics_of_a_doubtful_gateway_have_no_swing_and_no_calm_level() -> None:
    def metrics(doubt: Doubt | None) -> str:
        fleet = Fleet()
        fleet.hear("normal", 10.0, doubt)
        status = fleet.status(10.5)
        return format_fleet(fleet.state.evidence(10.5), [status], connected=True, invalid=0)

    place = '{site="north-yard",crane="crane-3",sensor="hook"'
    calm, doubtful = metrics(None), metrics(FORGED)
    assert f"plumbline_authenticated{place}}} 1" in calm
    assert f"plumbline_authenticated{place}}} 0" in doubtful
    assert f'plumbline_verdict{place},verdict="NOT AUTHENTICATED"}} 1' in doubtful
    assert f'plumbline_alert_level{place},level="normal"}} 1' in calm
    assert f'plumbline_alert_level{place},level="unknown"}} 1' in doubtful
    assert "phi_max_degrees" in calm
    assert "phi_max_degrees" not in doubtful
