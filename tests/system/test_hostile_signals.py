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
