"""The router of a fleet: what late joiners get, and that zenohd would be configured in the same way."""

import json
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
import zenoh

from gateway.bus.router import router_configuration, with_storage
from gateway.bus.session import TlsFiles, open_session
from gateway.topics import STATE_TOPICS
from tests.ports import unused_port
from tests.system.conftest import ROOT, Plumbline
from tests.waiting import PATIENCE_S, wait_until

OWN = "plumbline/v1/yard/c1/hook"
CONNECT_MS = round(1e3 * PATIENCE_S)


class Router:
    """`plumbline fleet router` as a process."""

    def __init__(self, endpoint: str, *options: str | Path) -> None:
        self.endpoint = endpoint
        self.arguments = ["fleet", "router", "--listen", endpoint, *map(str, options)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gateway", *self.arguments], cwd=ROOT, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        assert endpoint in self.process.stdout.readline()

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(PATIENCE_S)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


def stored(session: zenoh.Session, key: str) -> list[bytes]:
    return [reply.ok.payload.to_bytes() for reply in session.get(key, timeout=PATIENCE_S) if reply.ok is not None]


def _is_last(session: zenoh.Session, topic: str) -> bool:
    return stored(session, f"plumbline/v1/*/*/*/{topic}") == [b"last"]


@pytest.mark.slow
def test_a_late_joiner_gets_the_last_message_of_each_topic_also_of_a_gateway_that_is_gone() -> None:
    router = Router(f"tcp/127.0.0.1:{unused_port()}")
    gateway = open_session("client", [router.endpoint], [], None, CONNECT_MS)
    for text in (b"first", b"last"):
        for topic in (*STATE_TOPICS, "samples"):
            gateway.put(f"{OWN}/{topic}", text)
    gateway.put(f"{OWN}/health", b"x" * 100_000)
    gateway.put("plumbline/v1/a b/c/d/health", b"a name that no configuration allows")
    gateway.close()
    late = open_session("client", [router.endpoint], [], None, CONNECT_MS)
    for topic in STATE_TOPICS:
        wait_until(partial(_is_last, late, topic), f"the last message of {topic}")
    assert stored(late, "plumbline/v1/*/*/*/samples") == []
    late.close()
    assert router.stop() == 0


@pytest.mark.slow
def test_zenohd_is_told_the_same_and_to_store_the_latest_states(plumbline: Plumbline, tmp_path: Path) -> None:
    gateways = tmp_path / "gateways.txt"
    gateways.write_text("yard/c1/hook\n")
    for name in ("ca", "certificate", "key"):
        (tmp_path / name).touch()
    printed = plumbline(
        "fleet", "router", "--listen", "tls/10.0.0.2:7447", "--gateways", gateways, "--reader", "ann",
        *(part for name in ("ca", "certificate", "key") for part in (f"--{name}", tmp_path / name)), "--print-config",
    )  # fmt: skip
    assert printed.returncode == 0, printed.stderr
    configuration = json.loads(printed.stdout)
    zenoh.Config.from_json5(printed.stdout)  # zenohd's own parser
    storages = configuration["plugins"]["storage_manager"]["storages"]
    assert {storage["key_expr"] for storage in storages.values()} == {
        f"plumbline/v1/*/*/*/{each}" for each in STATE_TOPICS
    }
    assert configuration["access_control"]["default_permission"] == "deny"
    writers = {
        subject["id"]: subject["cert_common_names"]
        for subject in configuration["access_control"]["subjects"]
        if "cert_common_names" in subject
    }
    assert writers == {"readers": ["ann"], "yard/c1/hook": ["c1"]}


def test_the_example_of_a_zenohd_configuration_is_what_the_command_prints() -> None:
    example = (ROOT / "deploy" / "zenohd.json5").read_text()
    lines = [line for line in example.splitlines() if not line.lstrip().startswith("//")]

    folder = Path("/etc/plumbline/router")
    tls = TlsFiles(folder / "ca.pem", folder / "certificate.pem", folder / "key.pem")
    gateways = {f"plumbline/v1/yard/crane-{k}/hook": f"crane-{k}" for k in (1, 2)}
    assert json.loads("\n".join(lines)) == with_storage(
        router_configuration(["tls/0.0.0.0:7447"], tls, gateways, ["ann", "monitoring"], ["crane-1-load"])
    )
    zenoh.Config.from_json5(example)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--listen", "foo"], "foo is not an endpoint; an endpoint has the form"),
        (["--listen", "tls/127.0.0.1:7447#enable_mtls=false"], "has parameters, which could switch mutual TLS off"),
        (["--listen", "tcp/0.0.0.0:7447"], "open to the network"),
        (["--listen", "tls/0.0.0.0:7447"], "needs --ca"),
        (["--reader", "ann"], "name certificates"),
        (["--ca", "ca.pem"], "--certificate and --key missing"),
        (["--listen", "nonsense"], "nonsense"),
    ],
)
def test_a_wrong_router_is_one_clear_line(plumbline: Plumbline, options: list[str], problem: str) -> None:
    refused = plumbline("fleet", "router", *options)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert problem in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
