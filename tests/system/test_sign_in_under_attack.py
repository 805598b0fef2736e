"""Signing in on the page of a real gateway while another process attacks it: who has the PIN gets in, and the attack is known."""

import http.client
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gateway.page.sign_in import most_wrong_attempts
from tests.system.conftest import ROOT, BusPeer, JoinBus, RunningGateway, StartGateway
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow
GETS_IN_S = 5.0
"""Promised: whoever has the PIN is signed in within this time."""

ATTACK = """
import http.client, json, itertools, random, socket, sys, threading, time
port, kind, pause_s = int(sys.argv[1]), sys.argv[2], float(sys.argv[3])
origin = f"http://127.0.0.1:{port}"

def addresses():
    while True:
        numbers = [random.randrange(1, 255) for _ in range(3)]
        yield "127.0.0.1" if kind == "wrong_pins" else "127.{}.{}.{}".format(*numbers)

def guess():
    for address in addresses():
        try:
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10, source_address=(address, 0))
            body = json.dumps({"name": "Eve", "pin": f"{random.randrange(10**8):08d}"})
            connection.request("POST", "/api/sign-in", body, {"Origin": origin, "Content-Type": "application/json"})
            connection.getresponse().read()
            connection.close()
        except (OSError, http.client.HTTPException):
            pass
        time.sleep(pause_s)

def hold(content):
    held = []
    for address in addresses():
        try:
            connection = socket.create_connection(("127.0.0.1", port), 10, source_address=(address, 0))
            connection.sendall(content)
            held = [*held[-300:], connection]
        except OSError:
            pass
        time.sleep(pause_s)

work = {
    "wrong_pins": guess, "wrong_pins_of_many": guess,
    "silent": lambda: hold(b""),
    "half_sent": lambda: hold(b"POST /api/sign-in HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\nX: "),
    "stalled_readers": lambda: hold(b"GET /api/events HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\n\\r\\n"),
}[kind]
threads = [threading.Thread(target=work, daemon=True) for _ in range(4)]
for thread in threads:
    thread.start()
print("ready", flush=True)
for thread in threads:
    thread.join()
"""


@pytest.fixture
def attack() -> Iterator[Any]:
    """Starts attacking processes."""
    running: list[subprocess.Popen[str]] = []

    def start(gateway: RunningGateway, kind: str, pause_s: float = 0.0) -> None:
        command = [sys.executable, "-c", ATTACK, str(gateway.page_port), kind, str(pause_s)]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT))
        assert running[-1].stdout is not None
        assert running[-1].stdout.readline() == "ready\n"

    yield start
    for process in running:
        process.kill()
        process.communicate()


def _post(gateway: RunningGateway, path: str, content: Any, cookie: str = "") -> tuple[int, Any, str]:
    """Post as a person does, who tries again where the connection is lost. Status, content and cookie, in time."""
    begun_s = time.monotonic()
    while True:
        try:
            answer = _post_once(gateway, path, content, cookie)
        except (OSError, http.client.HTTPException):
            answer = None
        took_s = time.monotonic() - begun_s
        assert took_s < GETS_IN_S, f"{path}: not answered in {took_s:.1f} s"
        if answer is not None:
            return answer


def _post_once(gateway: RunningGateway, path: str, content: Any, cookie: str) -> tuple[int, Any, str]:
    host = f"127.0.0.1:{gateway.page_port}"
    connection = http.client.HTTPConnection(host, timeout=PATIENCE_S)
    headers = {"Origin": f"http://{host}", "Content-Type": "application/json", "Cookie": cookie}
    try:
        connection.request("POST", path, json.dumps(content), headers)
        response = connection.getresponse()
        return response.status, json.loads(response.read()), response.getheader("set-cookie", "").partition(";")[0]
    finally:
        connection.close()


def _sign_in(gateway: RunningGateway) -> str:
    """Sign in as a person does who looks up the PIN; return the cookie."""
    pin = (gateway.data_dir / "page-pin").read_text().strip()
    status, content, cookie = _post(gateway, "/api/sign-in", {"name": "Ann", "pin": pin})
    assert (status, content) == (http.HTTPStatus.OK, {"name": "Ann"})
    return cookie


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningGateway]:
    """A gateway that stands each attack but those that take its PIN."""
    running = RunningGateway(tmp_path_factory.mktemp("gateway"), page=True)
    yield running
    running.stop()


def _join(gateway: RunningGateway, join_bus: JoinBus) -> BusPeer:
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health")
    wait_until((gateway.data_dir / "page-pin").exists, "a PIN")
    return peer


def _is_signed_in(gateway: RunningGateway, cookie: str) -> bool:
    status, content, _ = _post(gateway, "/api/acknowledge", {"incident": "b00t-1"}, cookie)
    return status == http.HTTPStatus.CONFLICT and "no incident b00t-1" in content["text"]


@pytest.mark.parametrize(
    ("kind", "pause_s"),
    [("silent", 0.005), ("half_sent", 0.005), ("stalled_readers", 0.05)],  # of each of four threads
)
def test_who_has_the_pin_gets_in_while_connections_are_held(
    gateway: RunningGateway, join_bus: JoinBus, attack: Any, kind: str, pause_s: float
) -> None:
    _join(gateway, join_bus)
    attack(gateway, kind, pause_s)
    for _ in range(5):
        assert _is_signed_in(gateway, _sign_in(gateway))


def test_who_has_the_pin_gets_in_beside_wrong_pins_of_the_same_address(
    gateway: RunningGateway, join_bus: JoinBus, attack: Any
) -> None:
    peer = _join(gateway, join_bus)
    pin = (gateway.data_dir / "page-pin").read_text()
    attack(gateway, "wrong_pins", 0.25)
    for _ in range(5):
        assert _is_signed_in(gateway, _sign_in(gateway))
    health = peer.wait_for("health", lambda message: message["refused"].get("wrong_pin", 0) >= 20)
    assert "pin_guessed" not in health["standing_faults"]
    assert (gateway.data_dir / "page-pin").read_text() == pin
    lines = [json.loads(line) for line in (gateway.data_dir / "security.jsonl").read_text().splitlines()]
    assert {(line["key"], line["kind"], line["origin"]) for line in lines} == {
        ("page/sign-in", "wrong_pin", "127.0.0.1")
    }


def test_a_pin_that_many_addresses_guess_at_is_void_with_a_fault_and_nobody_is_locked_out(
    start_gateway: StartGateway, join_bus: JoinBus, attack: Any
) -> None:
    gateway = start_gateway(page=True)
    peer = _join(gateway, join_bus)
    path: Path = gateway.data_dir / "page-pin"
    pin = path.read_text().strip()
    cookie = _sign_in(gateway)
    attack(gateway, "wrong_pins_of_many")
    health = peer.wait_for("health", lambda message: "pin_guessed" in message["standing_faults"])
    assert health["refused"]["wrong_pin"] >= most_wrong_attempts(pin)
    assert str(path) in health["standing_faults"]["pin_guessed"]
    assert _is_signed_in(gateway, cookie)
    status, content, _ = _post(gateway, "/api/sign-in", {"name": "Eve", "pin": pin})
    assert (status, content) == (403, {"error": "pin_wrong"})
    for _ in range(5):
        assert _is_signed_in(gateway, _sign_in(gateway))
    assert len(path.read_text().strip()) > len(pin)
    peer.wait_for("health", lambda message: "pin_guessed" not in message["standing_faults"])
