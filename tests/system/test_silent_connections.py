"""Whoever opens connections to the bus without end, and says nothing, keeps nobody out, and is shown."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from gateway.bus.client import GatewayClient
from gateway.bus.credentials import load_credentials
from tests.gateway.pki.site import Site
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.conftest import JoinBus, StartGateway
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

PER_S = 800
"""The library lets 100 be opening for 10 s each, or with the gateway's own settings 4096 for 3 s."""
ADDRESSES = 200
"""The bus does not ask where a connection comes from."""
WITHIN_S = 5.0
OPEN = """
import resource, selectors, socket, sys, time
port, addresses, per_s = map(int, sys.argv[1:])
resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
selector, count, begun_s = selectors.DefaultSelector(), 0, time.monotonic()
print("ready", flush=True)
while True:
    while count < (time.monotonic() - begun_s) * per_s:
        count += 1
        connection = socket.socket()
        connection.setblocking(False)
        connection.bind((f"127.0.0.{2 + count % addresses}", 0))
        connection.connect_ex(("127.0.0.1", port))
        selector.register(connection, selectors.EVENT_READ)
    for key, _ in selector.select(0.002):
        selector.unregister(key.fileobj)  # it was closed
        key.fileobj.close()
"""


FAIL = """
import contextlib, socket, sys, time
port, per_s = map(int, sys.argv[1:])
count, begun_s = 0, time.monotonic()
print("ready", flush=True)
while True:
    while count < (time.monotonic() - begun_s) * per_s:
        count += 1
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 60) as connection:
            connection.sendall(b"x")  # no beginning of TLS, and the end
    time.sleep(0.005)
"""
FAILING_PER_S = 100
FILES = 512


@contextmanager
def attack(program: str, *arguments: int) -> Iterator[None]:
    command = [sys.executable, "-c", program, *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield
        assert process.poll() is None
    finally:
        process.kill()
        process.communicate()


def test_silent_connections_without_end_keep_nobody_out_and_are_shown(
    start_gateway: StartGateway, join_bus: JoinBus
) -> None:
    gateway = start_gateway()
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    credentials = load_credentials(gateway.data_dir)
    took_s = []
    with attack(OPEN, gateway.bus_port, ADDRESSES, PER_S):
        shown = peer.wait_for("health", lambda message: "bus_connections" in message["standing_faults"])
        for number in range(8):
            begun_s = time.monotonic()
            with closing(GatewayClient(gateway.endpoint, KEY, credentials)) as client:
                request = {"id": f"mark-{number:08}", "by": "ann", "text": "x"}
                assert present(client.ask("mark", request, PATIENCE_S)).text == "marked: x"
            took_s.append(time.monotonic() - begun_s)
    assert max(took_s) < WITHIN_S, took_s
    assert "open no link" in shown["standing_faults"]["bus_connections"]
    peer.wait_for("health", lambda message: "bus_connections" not in message["standing_faults"])
    assert gateway.process.poll() is None


def test_failing_handshakes_without_end_take_the_gateway_no_files_and_recording_goes_on(
    start_gateway: StartGateway, join_bus: JoinBus, tmp_path: Path
) -> None:
    port, local = unused_port(), f"tcp/127.0.0.1:{unused_port()}"
    listen = json.dumps([f"tls/127.0.0.1:{port}", local])
    environment = {"PLUMBLINE_BUS__LISTEN": listen, "PLUMBLINE_RECORDER__SEGMENT_S": "10"}
    limited = "prlimit", f"--nofile={FILES}:{FILES}"
    gateway = start_gateway(Site(tmp_path / "keys").gateway_toml(), environment=environment, prefix=limited)
    peer = join_bus(local)
    peer.wait_for("health")
    with attack(FAIL, port, FAILING_PER_S):
        peer.wait_for("health", lambda message: "bus_connections" in message["standing_faults"])
        before = set(gateway.recordings)
        wait_until(lambda: len(set(gateway.recordings) - before) >= 2, "two more segments")
        heard = len(peer.messages("alert"))
        wait_until(lambda: len(peer.messages("alert")) > heard, "alerts over a link that came back")
    code, log = gateway.stop()
    assert (code, "the bus is closed and opened again" in log) == (0, True), log
    assert "Too many open files" not in log
