"""`plumbline fleet status` on real gateways, as a person and a monitoring system see it."""

import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
import zenoh

from tests.ports import unused_port
from tests.system.conftest import ROOT, JoinBus, Plumbline, RunningGateway
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow


class Site:
    """Two gateways that connect to one router."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        config = zenoh.Config()
        for key, value in (
            ("mode", "router"),
            ("listen/endpoints", [self.endpoint]),
            ("scouting/multicast/enabled", False),
        ):
            config.insert_json5(key, json.dumps(value))
        self.router = zenoh.open(config)
        self.gateways = {crane: self._start(folder, crane) for crane in ("c1", "c2")}

    def _start(self, folder: Path, crane: str) -> RunningGateway:
        (folder / crane).mkdir()
        environment = {"PLUMBLINE_BUS__CONNECT": json.dumps([self.endpoint]), "PLUMBLINE_GATEWAY__CRANE": crane}
        toml = '[gateway]\nsite = "yard"\n[alerts]\nwarn_deg = 80\ntrip_deg = 85\nclear_deg = 70\nlean_trip_deg = 80\n'
        return RunningGateway(folder / crane, toml, environment=environment)

    def close(self) -> None:
        for gateway in self.gateways.values():
            gateway.process.kill()
            gateway.process.communicate()
        self.router.close()


@pytest.fixture
def site(tmp_path: Path, join_bus: JoinBus) -> Iterator[Site]:
    running = Site(tmp_path)
    peer = join_bus(running.endpoint)
    cranes = set(running.gateways)
    wait_until(lambda: {key.split("/")[3] for _, key, _ in list(peer.heard)} >= cranes, "messages of both gateways")
    yield running
    running.close()


def test_all_gateways_of_a_router_are_listed_with_exit_codes_for_monitoring(
    site: Site, plumbline: Plumbline, tmp_path: Path
) -> None:
    expected = tmp_path / "gateways.txt"
    expected.write_text("yard/c1/hook-1\nyard/c2/hook-1\n")

    def status(*options: str | Path) -> subprocess.CompletedProcess[str]:
        return plumbline("fleet", "status", "--connect", site.endpoint, "--accept", "disturbed,unknown", *options)

    wait_until(lambda: status("--expect", expected).returncode == 0, "two gateways that are well")
    content = json.loads(status("--expect", expected, "--json", "-").stdout)
    assert {gateway["crane"] for gateway in content["gateways"]} == {"c1", "c2"}  # the order is by state
    assert all(gateway["alive"] and gateway["software"] and gateway["boot_id"] for gateway in content["gateways"])
    assert content["invalid"] == 0

    expected.write_text("yard/c1/hook-1\nyard/c3/hook-1\n")
    missing = status("--expect", expected)
    assert missing.returncode == 1
    assert "1 MISSING" in missing.stdout.splitlines()[0]
    assert "not on the list of expected gateways: yard/c2/hook-1" in missing.stdout
    assert status("--crane", "c1", "--expect", expected).returncode == 0
    assert status("--site", "no-such-site").returncode == 1
    wrong = status("--state", "broken")
    assert (wrong.returncode, "choose from" in wrong.stderr, "Traceback" in wrong.stderr) == (2, True, False)


def _contains_all(scrape: Callable[[], str], wanted: Sequence[str]) -> bool:
    text = scrape()
    return all(each in text for each in wanted)


def test_the_metrics_of_all_gateways_are_on_one_endpoint(site: Site) -> None:
    port = unused_port()
    command = [
        sys.executable,
        "-m",
        "gateway",
        "fleet",
        "metrics",
        "--listen",
        f"127.0.0.1:{port}",
        "--connect",
        site.endpoint,
    ]
    exporter = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)

    def scrape(host: str = "127.0.0.1") -> str:
        with urlopen(Request(f"http://127.0.0.1:{port}/metrics", headers={"Host": host}), timeout=PATIENCE_S) as answer:
            text: str = answer.read().decode()
            return text

    try:
        assert exporter.stdout is not None
        assert f"http://127.0.0.1:{port}/metrics" in exporter.stdout.readline()
        for name in ("up", "samples_total"):
            wanted = [f'plumbline_{name}{{site="yard",crane="{crane}",sensor="hook-1"}} ' for crane in ("c1", "c2")]
            wait_until(partial(_contains_all, scrape, wanted), f"{name} of both gateways")
        text = scrape()
        assert text.count("# TYPE plumbline_up gauge") == 1
        assert "plumbline_fleet_router_connected{} 1\n" in text
        with pytest.raises(HTTPError, match="400"):
            scrape(host="evil.example")
        site.gateways["c1"].process.kill()
        wait_until(lambda: 'plumbline_up{site="yard",crane="c1",sensor="hook-1"} 0' in scrape(), "the killed gateway")
        assert 'phi_max_degrees{site="yard",crane="c1"' not in scrape()
    finally:
        exporter.terminate()
        assert exporter.wait(PATIENCE_S) in (0, -signal.SIGTERM)
        assert exporter.stdout is not None
        exporter.stdout.close()


def test_a_killed_and_a_frozen_gateway_are_seen_in_a_terminal_that_is_redrawn(site: Site) -> None:
    leader, follower = pty.openpty()
    watching = subprocess.Popen(
        [sys.executable, "-m", "gateway", "fleet", "status", "--watch", "--interval-s", "0.3", "--connect", site.endpoint],
        cwd=ROOT, stdout=follower, stderr=subprocess.STDOUT,
    )  # fmt: skip
    os.close(follower)
    shown = b""

    def appears(pattern: bytes) -> bool:
        nonlocal shown
        with suppress(OSError):  # the program has closed the terminal
            while select.select([leader], [], [], 0.05)[0]:
                shown += os.read(leader, 65536)
        return re.search(pattern, shown) is not None

    try:
        wait_until(lambda: appears(rb"2 gateways"), "the list")
        site.gateways["c1"].process.kill()
        wait_until(lambda: appears(rb"yard/c1/hook-1 +GONE"), "the killed gateway")
        site.gateways["c2"].process.send_signal(signal.SIGSTOP)
        wait_until(lambda: appears(rb"yard/c2/hook-1 +(GONE|STALE)"), "the frozen gateway")
        site.gateways["c2"].process.send_signal(signal.SIGCONT)
        site.router.close()
        wait_until(lambda: appears(rb"no connection to the router"), "the lost router")
        watching.send_signal(signal.SIGINT)
        watching.wait(PATIENCE_S)
        assert appears(rb"\x1b\[\?25h\x1b\[\?1049l$")
        assert b"Traceback" not in shown
    finally:
        watching.kill()
        watching.wait()
        os.close(leader)


def test_a_hostile_publisher_ends_nothing_and_forges_no_line(site: Site, plumbline: Plumbline) -> None:
    session = zenoh.open(zenoh.Config.from_json5(
        json.dumps({"mode": "client", "connect": {"endpoints": [site.endpoint]}, "scouting": {"multicast": {"enabled": False}}})
    ))  # fmt: skip
    payloads = [b"\xff\xfe", b"{" * 60_000, b"x" * 5_000_000, b'{"level":"normal"}', b"\x1b[2J"]
    end_s = time.monotonic() + PATIENCE_S
    watch = ("--watch", "--count", "5", "--interval-s", "0.5", "--connect", site.endpoint)
    process = subprocess.Popen(
        [sys.executable, "-m", "gateway", "fleet", "status", *watch],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while time.monotonic() < end_s and process.poll() is None:
        for payload in payloads:
            for name in ("yard/c1/hook-1/alert", "yard/c1/hook-1/health", "a/b/\u202eevil/alert"):
                session.put(f"plumbline/v1/{name}", payload)
        time.sleep(0.05)
    out, err = process.communicate(timeout=PATIENCE_S)
    session.close()
    assert err == ""
    assert process.returncode in (0, 1)
    assert "yard/c1/hook-1" in out
    assert "evil" not in out
    assert "\x1b" not in out
