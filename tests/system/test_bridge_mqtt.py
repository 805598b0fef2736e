"""The MQTT bridge at a real Mosquitto: alerts over failures of the broker, refusals, certificates, and what stays retained."""

import base64
import hashlib
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from gateway.pki.site_folder import Holder
from tests.gateway.pki.site import Site
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.conftest import RunningGateway, StartGateway
from tests.system.mosquitto import Mosquitto, Subscriber
from tests.system.running_bridge import RunningBridge
from tests.system.test_alert_delivery import CHATTERING, stored
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

PLACE = KEY.removeprefix("plumbline/v1/")


@pytest.fixture
def start_bridge(tmp_path: Path) -> Iterator[Callable[..., RunningBridge]]:
    """Starts bridges with lines of `[mqtt]`, which do not outlive the test."""
    running: list[RunningBridge] = []

    def start(gateway: RunningGateway, *lines: str) -> RunningBridge:
        settings = tmp_path / "bridge.toml"
        position = f'position_file = "{tmp_path / "position.json"}"'
        settings.write_text("\n".join(["demonstration = true", "[mqtt]", position, *lines]) + "\n")
        running.append(RunningBridge("mqtt", gateway.endpoint, settings))
        return running[-1]

    yield start
    for bridge in running:
        bridge.end()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    broker = Mosquitto(tmp_path)
    yield broker
    broker.stop()


StartBridge = Callable[..., RunningBridge]


def test_every_alert_arrives_once_in_order_over_restarts_of_broker_and_bridge(
    start_gateway: StartGateway, broker: Mosquitto, start_bridge: StartBridge
) -> None:
    gateway = start_gateway(CHATTERING)
    gateways = [gateway]
    settings = (f"port = {broker.port}", 'home_assistant = "homeassistant"')
    bridge = start_bridge(gateway, *settings)
    subscriber = Subscriber(broker.port, "#")

    def received() -> list[tuple[str, int]]:
        changes = [(each["boot_id"], each["alert_number"]) for each in subscriber.contents("/alert")]
        return list(dict.fromkeys(changes))  # one that was acknowledged too late comes twice, and is recognised

    def one_more() -> tuple[str, int]:
        """The last alert of a gateway that was killed and starts again: it states what it knows as changes."""
        before = len(stored(gateway))
        gateways[-1].stop(signal.SIGKILL)
        gateways.append(start_gateway(CHATTERING, environment={"PLUMBLINE_BUS__LISTEN": f'["{gateway.endpoint}"]'}))
        wait_until(lambda: len(stored(gateway)) >= before + 2, "alerts of the gateway")
        return stored(gateway)[-1]

    numbered = partial(filter, lambda state: state["alert_number"] is not None)
    wait_until(lambda: len(list(numbered(subscriber.contents("/state")))) > 12, "some heartbeats of the alerts")
    missed = one_more()
    wait_until(lambda: missed in received(), "an alert")
    broker.stop()
    missed = one_more()
    broker.start()
    wait_until(lambda: missed in received(), "the alert that the broker has missed")
    broker.signal(signal.SIGSTOP)
    bridge.end()
    missed = one_more()
    broker.signal(signal.SIGCONT)
    start_bridge(gateway, *settings)
    wait_until(lambda: missed in received(), "the alert that the bridge has missed")
    gateways[-1].stop()
    got = received()
    sent = stored(gateway)
    assert got == sent[sent.index(got[0]) :][: len(got)]
    assert len(subscriber.contents("/angle_deg/config")) >= 1
    subscriber.close()


@pytest.mark.parametrize("version", ["5", "3.1.1"])
def test_a_consumer_that_joins_after_the_end_of_the_bridge_finds_no_number(
    start_gateway: StartGateway, broker: Mosquitto, start_bridge: StartBridge, version: str
) -> None:
    gateway = start_gateway(CHATTERING)
    bridge = start_bridge(gateway, f"port = {broker.port}", f'version = "{version}"')
    subscriber = Subscriber(broker.port, "#", version=version)
    wait_until(lambda: (subscriber.last("/state") or {}).get("angle_deg") is not None, "an angle")
    bridge.end()
    wait_until(lambda: subscriber.last("/state")["state"] == "bridge gone", "the will of a bridge that was killed")
    late = Subscriber(broker.port, "#", version=version)
    wait_until(lambda: late.last("/state"), "a retained state")
    assert (late.last("/state")["angle_deg"], late.last("/state")["available"]) == (None, False)
    bridge = start_bridge(gateway, f"port = {broker.port}", f'version = "{version}"')
    wait_until(lambda: late.last("/state")["angle_deg"] is not None, "an angle again")
    code, err = bridge.stop()
    assert (code, "WARNING" in err) == (0, False), err  # its own end is no failure
    assert f"{KEY}: fine: " in err
    wait_until(lambda: late.last("/state")["state"] == "bridge gone", "the last word of a bridge that was stopped")
    subscriber.close()
    late.close()


def test_a_wrong_password_and_missing_rights_are_said_and_harm_nothing(
    start_gateway: StartGateway, start_bridge: StartBridge, tmp_path: Path
) -> None:
    users, rights, password = tmp_path / "users", tmp_path / "rights", tmp_path / "password"
    users.write_text(_mosquitto_user("crane", "right"))
    rights.write_text("user crane\ntopic read #\n")
    users.chmod(0o600)
    broker = Mosquitto(tmp_path, f"password_file {users}", f"acl_file {rights}", anonymous=False)
    gateway = start_gateway(CHATTERING)
    settings = (f"port = {broker.port}", 'user = "crane"', f'password_file = "{password}"')
    password.write_text("wrong\n")
    bridge = start_bridge(gateway, *settings)
    wait_until(lambda: bridge.says("refuses the connection: Not authorized"), "the refusal")
    code, err = bridge.stop()
    assert (code, "Traceback" in err) == (0, False)
    password.write_text("right\n")
    bridge = start_bridge(gateway, *settings)
    subscriber = Subscriber(broker.port, "#", prepare=lambda client: client.username_pw_set("crane", "right"))
    wait_until(lambda: bridge.says(f"refuses plumbline/{PLACE}/state: Not authorized; does its ACL"), "the refusal")
    code, err = bridge.stop()
    assert (code, "Traceback" in err) == (0, False)
    assert subscriber.contents("/state") == []
    subscriber.close()
    broker.stop()


def _mosquitto_user(name: str, password: str) -> str:
    """A line of a password file, by Mosquitto's own hash: PBKDF2 with SHA-512."""
    salt, rounds = b"0123456789ab", 101
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, rounds)
    return f"{name}:$7${rounds}${base64.b64encode(salt).decode()}${base64.b64encode(digest).decode()}\n"


def test_two_bridges_of_one_name_are_told_that_they_take_turns(
    start_gateway: StartGateway, broker: Mosquitto, start_bridge: StartBridge
) -> None:
    gateway = start_gateway(CHATTERING)
    first, second = (start_bridge(gateway, f"port = {broker.port}") for _ in range(2))
    why = "is there another client with the id plumbline-" + PLACE.replace("/", "-")
    wait_until(lambda: first.says(why) or second.says(why), why)


def test_with_tls_both_sides_show_a_certificate_of_the_site(
    start_gateway: StartGateway, start_bridge: StartBridge, tmp_path: Path
) -> None:
    keys = Site(tmp_path / "keys")
    server = keys.issue("broker", Holder.ROUTER)
    client = keys.issue("mqtt-bridge", Holder.OPERATOR)
    listener = (
        f"cafile {server}/ca.pem\ncertfile {server}/certificate.pem\nkeyfile {server}/key.pem\nrequire_certificate true"
    )
    broker = Mosquitto(tmp_path, listener=listener)
    gateway = start_gateway(CHATTERING)
    ca = f'ca = "{client}/ca.pem"'
    stranger = start_bridge(gateway, f"port = {broker.port}", ca)
    foreign = Site(tmp_path / "foreign").issue("broker", Holder.ROUTER) / "ca.pem"
    own = (f'certificate = "{client}/certificate.pem"', f'key = "{client}/key.pem"')
    subscriber = Subscriber(
        broker.port,
        "#",
        prepare=lambda mqtt: mqtt.tls_set(f"{client}/ca.pem", f"{client}/certificate.pem", f"{client}/key.pem"),
    )
    wait_until(lambda: stranger.says("does it want a certificate of this client, mqtt.certificate?"), "the refusal")
    assert subscriber.contents("/state") == []
    assert stranger.stop()[0] == 0
    for lines, why in (
        ((f"port = {broker.port}",), "does it want TLS, and so mqtt.ca?"),
        ((f"port = {unused_port()}",), "cannot be reached: Connection refused; look at mqtt.host and mqtt.port"),
        ((f"port = {broker.port}", f'ca = "{foreign}"'), "has a certificate that is not taken: "),
        ((f"port = {gateway.bus_port}", ca), "does not agree on TLS ("),
    ):
        stranger = start_bridge(gateway, *lines)
        wait_until(partial(stranger.says, why), why)
        stranger.end()
    start_bridge(gateway, f"port = {broker.port}", ca, *own)
    wait_until(lambda: (subscriber.last("/state") or {}).get("angle_deg") is not None, "an angle over TLS")
    subscriber.close()
    broker.stop()
