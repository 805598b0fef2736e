"""The table of what a consumer knows of a gateway."""

from dataclasses import replace

import pytest

from gateway.gateway_state import BY_VALIDITY, HEARTBEAT_S, GatewayPresence, GatewayState
from gateway.messages import Validity
from tests.gateway.bus.test_alert_sequence import alert
from tests.gateway.scene import Scene

NOW_S = 100.0
PATIENCE_S = 0.6
LATE_S = HEARTBEAT_S + PATIENCE_S


def presence(
    validity: Validity | None,
    *,
    age_s: float = 0.5,
    sign_of_life_age_s: float | None = None,
    is_alive: bool | None = True,
) -> GatewayPresence:
    found = GatewayPresence(is_alive=is_alive, connected_s=0.0)
    found.hear(replace(alert("b", 1, is_change=False), validity=validity), NOW_S - age_s)
    if sign_of_life_age_s is not None:
        found.hear(Scene().health(), NOW_S - sign_of_life_age_s)
    return found


@pytest.mark.parametrize(("validity", "state"), BY_VALIDITY.items())
def test_the_last_message_decides_while_it_is_young(validity: Validity, state: GatewayState) -> None:
    assert presence(validity).judge(NOW_S, PATIENCE_S, is_linked=True) is state


@pytest.mark.parametrize(
    ("given", "is_linked", "state"),
    [
        (presence("valid"), False, GatewayState.LINK_GONE),
        (presence("valid", is_alive=False), True, GatewayState.GATEWAY_GONE),
        (presence("valid", age_s=LATE_S + 0.1), True, GatewayState.GATEWAY_GONE),
        (presence("valid", age_s=60.0, sign_of_life_age_s=0.5), True, GatewayState.NOT_KNOWN),
        (presence("valid", age_s=60.0, sign_of_life_age_s=LATE_S + 0.1), True, GatewayState.GATEWAY_GONE),
        (presence("valid", age_s=60.0, sign_of_life_age_s=0.5, is_alive=False), True, GatewayState.GATEWAY_GONE),
        (presence("no_samples", age_s=LATE_S + 0.1), True, GatewayState.GATEWAY_GONE),
        (presence("valid", is_alive=None), True, GatewayState.FINE),
        (presence(None), True, GatewayState.NOT_KNOWN),
        (GatewayPresence(connected_s=NOW_S - 0.5), True, GatewayState.NOT_KNOWN),
        (GatewayPresence(connected_s=NOW_S - LATE_S - 0.1), True, GatewayState.GATEWAY_GONE),
        (GatewayPresence(connected_s=NOW_S - LATE_S - 0.1), False, GatewayState.LINK_GONE),
    ],
)
def test_what_is_gone_is_said_before_anything_else(
    given: GatewayPresence, is_linked: bool, state: GatewayState
) -> None:
    assert given.judge(NOW_S, PATIENCE_S, is_linked=is_linked) is state


def test_a_link_that_has_just_come_back_leaves_the_gateway_time_to_send() -> None:
    given = presence("valid", age_s=20.0)
    given.connected_s = NOW_S - 0.3
    assert given.judge(NOW_S, PATIENCE_S, is_linked=True) is GatewayState.NOT_KNOWN
