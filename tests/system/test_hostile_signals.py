"""What is not signed on the bus, load signals and tokens of presence, misleads nobody: with a hostile process."""

import json
import time

import pytest

from tests.system.bus_query import KEY, query_signed
from tests.system.conftest import Hostile, JoinBus, StartGateway

pytestmark = pytest.mark.slow


def test_a_forged_load_signal_opens_no_interlock(
    start_gateway: StartGateway, join_bus: JoinBus, hostile: Hostile
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["samples"] > 0)
    hostile(
        gateway.endpoint,
        f"""
while True:
    session.put("{KEY}/load", b'{{"loaded": false}}')
    time.sleep(0.01)
""",
    )
    for number in range(8):
        peer.session.put(f"{KEY}/load", b'{"loaded": true}')  # the load cell
        time.sleep(0.3)
        payload = json.dumps({"id": f"request-{number}", "by": "ann", "housing_off_rope": True}).encode()
        ((accepted, content),) = query_signed(peer.session, "recalibrate", payload, gateway.data_dir)
        assert not accepted, content
        assert "a load hangs on the hook" in content["reason"]


def test_a_forged_token_of_presence_is_counted_and_is_no_fault(
    start_gateway: StartGateway, join_bus: JoinBus, hostile: Hostile
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["samples"] > 0)
    hostile(
        gateway.endpoint,
        f"""
tokens = [session.liveliness().declare_token("{KEY}/alive/%012x" % number) for number in range(200)]
own = [str(each.ok.key_expr) for each in session.liveliness().get("{KEY}/alive/*") if each.ok][0].split("/")[-1]
proof = f"{KEY}/alive/000000000001/{{own}}/" + "0" * 128
tokens.append(session.liveliness().declare_token(proof))
time.sleep(3600)
""",
    )
    counted = peer.wait_for("health", lambda message: message["refused"].get("unproved_presence"))
    assert counted["standing_faults"] == {}
    lines = (gateway.data_dir / "security.jsonl").read_text()
    assert "somebody who pretends to be one" in lines
