"""Whoever opens connections to the bus and says nothing keeps nobody out, up to the number that is stated."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from gateway.bus.session import MOST_PENDING
from tests.system.conftest import JoinBus, Plumbline, StartGateway
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

SILENT = MOST_PENDING - 112
"""The library's own limit, 100, would keep everybody out."""
HOLD = """
import selectors, socket, sys
selector = selectors.DefaultSelector()

def connect():
    connection = socket.create_connection(("127.0.0.1", int(sys.argv[1])), 60)
    selector.register(connection, selectors.EVENT_READ)

for _ in range(int(sys.argv[2])):
    connect()
print("ready", flush=True)
while True:
    for key, _ in selector.select():
        selector.unregister(key.fileobj)  # it was closed: another one takes its place
        key.fileobj.close()
        connect()
"""


@contextmanager
def silent_connections(port: int) -> Iterator[None]:
    command = [sys.executable, "-c", HOLD, str(port), str(SILENT)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield
        assert process.poll() is None
    finally:
        process.kill()
        process.communicate()


def test_silent_connections_keep_nobody_out_and_are_shown(
    start_gateway: StartGateway, plumbline: Plumbline, join_bus: JoinBus
) -> None:
    gateway = start_gateway()
    status = "remote", "status", "--connect", gateway.endpoint, "--json", "-"
    wait_until(lambda: plumbline(*status).returncode == 0, "the gateway")
    with silent_connections(gateway.bus_port):
        mark = "remote", "mark", "x", "--by", "ann", "--connect", gateway.endpoint, "--credentials", gateway.data_dir
        marked = [plumbline(*mark) for _ in range(4)]
        peer = join_bus(gateway.endpoint)
        shown = peer.wait_for("health", lambda message: "bus_connections" in message["standing_faults"])
    assert "open no link" in shown["standing_faults"]["bus_connections"]
    peer.wait_for("health", lambda message: "bus_connections" not in message["standing_faults"])
    assert [(each.returncode, each.stdout) for each in marked] == [(0, "mark: marked: x\n")] * 4
    assert json.loads(plumbline(*status).stdout)
