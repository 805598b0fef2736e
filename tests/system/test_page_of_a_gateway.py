"""The whole way: a simulated crane swings, and a browser sees the angle move."""

import json
import os
import re
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from playwright.sync_api import Browser, expect

from tests.page_sound import LOST_HZ, turn_sound_on, wait_for_tone
from tests.ports import unused_port
from tests.system.bus_query import KEY
from tests.system.conftest import JoinBus, RunningGateway, StartGateway
from tests.values import present
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

HEALTHY = 200


def test_the_angle_moves_on_the_page(start_gateway: StartGateway, join_bus: JoinBus, browser: Browser) -> None:
    gateway = start_gateway(page=True)
    join_bus(gateway.endpoint).wait_for(
        "swing", lambda message: message["coverage95_deg"] is not None, timeout_s=2 * PATIENCE_S
    )
    page = browser.new_page(viewport={"width": 800, "height": 480})
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(f"http://127.0.0.1:{gateway.page_port}/")
    number = page.locator("#phi")
    expect(number).to_have_text(re.compile(r"\d"), timeout=1e3 * PATIENCE_S)
    first = number.inner_text()
    expect(number).not_to_have_text(first, timeout=1e3 * PATIENCE_S)
    expect(page.locator("body")).to_contain_text("simulated-1")
    with urlopen(f"http://127.0.0.1:{gateway.page_port}/healthz", timeout=PATIENCE_S) as answer:
        assert answer.status == HEALTHY
    turn_sound_on(page)
    gateway.process.kill()
    expect(page.locator("#word")).to_have_text(re.compile("NO DATA|STALE|NO CONTACT"))
    wait_for_tone(page, LOST_HZ)
    assert errors == []
    page.close()


def _state(gateway: RunningGateway) -> Any:
    try:
        with urlopen(f"http://127.0.0.1:{gateway.page_port}/api/state", timeout=PATIENCE_S) as answer:
            return json.load(answer)
    except OSError:  # the page is not there yet
        return {"verdict": {"word": "NO DATA"}, "topics": {}}


def _is_live(gateway: RunningGateway) -> bool:
    return _state(gateway)["verdict"]["word"] not in ("NO DATA", "STALE")


@pytest.fixture(scope="module")
def gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningGateway]:
    """A gateway that is well again after each test that takes it."""
    running = RunningGateway(tmp_path_factory.mktemp("gateway"), page=True)
    yield running
    running.stop()


def test_forged_messages_on_the_bus_do_not_reach_the_page(gateway: RunningGateway, join_bus: JoinBus) -> None:
    peer = join_bus(gateway.endpoint)
    wait_until(lambda: "swing" in _state(gateway)["topics"], "a swing on the page")
    forged = {"alert": peer.wait_for("alert"), "swing": peer.wait_for("swing"), "condition": peer.wait_for("condition")}
    forged["alert"] |= {"level": "trip", "text": "a lie"}
    forged["swing"] |= {"phi_max_deg": 77.0, "swinging": True}
    forged["condition"] |= {"reasons": ["a lie"]}
    for _ in range(40):
        for topic, message in forged.items():
            message["time_ns"] += 10**9
            peer.session.put(f"{KEY}/{topic}", json.dumps(message))
        shown = _state(gateway)["topics"]
        assert "a lie" not in json.dumps(shown)
        assert shown["swing"]["phi_max_deg"] != forged["swing"]["phi_max_deg"]
        time.sleep(0.05)


def test_a_gateway_that_hangs_is_stale_and_comes_back(gateway: RunningGateway) -> None:
    wait_until(lambda: _is_live(gateway), "a live page")
    gateway.process.send_signal(signal.SIGSTOP)
    wait_until(lambda: not _is_live(gateway), "STALE")
    gateway.process.send_signal(signal.SIGCONT)
    wait_until(lambda: _is_live(gateway), "a live page again")


def test_the_page_does_not_depend_on_the_bus(start_gateway: StartGateway) -> None:
    """A client whose default listener routes nothing: nobody is reached over the bus, and the page is live."""
    router = unused_port()
    with socket.create_server(("127.0.0.1", router)):  # accepts, and never speaks
        gateway = start_gateway(page=True, environment={"PLUMBLINE_BUS__CONNECT": f'["tcp/127.0.0.1:{router}"]'})
        wait_until(lambda: _is_live(gateway), "a live page")


SENSITIVE = "[alerts]\nwarn_deg = 0.5\ntrip_deg = 1.0\nclear_deg = 0.2\n"


def test_an_alarm_is_acknowledged_on_the_page_by_name_and_its_list_outlives_page_and_gateway(
    start_gateway: StartGateway, join_bus: JoinBus, browser: Browser
) -> None:
    gateway = start_gateway(SENSITIVE, page=True)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("alert", lambda message: message["level"] == "trip", timeout_s=2 * PATIENCE_S)
    page = browser.new_page(viewport={"width": 800, "height": 480})
    page.goto(f"http://127.0.0.1:{gateway.page_port}/")
    page.locator("#acknowledge").click()
    page.locator("#sign-in-name").fill("Ann")
    page.locator("#sign-in-pin").fill((gateway.data_dir / "page-pin").read_text().strip())
    page.keyboard.press("Enter")
    change = peer.wait_for("alert", lambda message: message["event"] == "acknowledged")
    assert change["acknowledged_by"] == "Ann"  # sent unstored where the disk is slow; the list below is what outlives
    expect(page.locator("#acknowledged")).to_have_text(re.compile(r"\d\d:\d\d Ann"))
    page.close()

    first = _listed(gateway)[0]
    os.kill(present(_page_process(gateway)), signal.SIGKILL)
    wait_until(lambda: _is_live(gateway), "another process of the page")
    assert first in _listed(gateway)
    gateway.stop()
    again = start_gateway(SENSITIVE, page=True)
    wait_until(lambda: _is_live(again), "the page of the next start")
    assert first in _listed(again)
    again.process.kill()
    again.process.wait()
    wait_until(lambda: not _listens(again.page_port), "the page to end with its gateway")


def _alerts(gateway: RunningGateway) -> list[Any]:
    alerts: list[Any] = _state(gateway).get("alert_log", {"alerts": []})["alerts"]
    return alerts


def _listed(gateway: RunningGateway) -> list[tuple[Any, ...]]:
    return [tuple(alert[name] for name in ("rule", "since_ns", "incident")) for alert in _alerts(gateway)]


def _page_process(gateway: RunningGateway) -> int | None:
    pid = gateway.process.pid
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if b"gateway.page" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0"):
            return int(child)
    return None


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
