"""The whole way: a simulated crane swings, and a browser sees the angle move."""

import re
from urllib.request import urlopen

import pytest
from playwright.sync_api import Browser, expect

from tests.system.conftest import JoinBus, StartGateway
from tests.waiting import PATIENCE_S

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
    gateway.process.kill()
    expect(page.locator("#word")).to_have_text(re.compile("NO DATA|STALE|NO CONTACT"), timeout=10_000)
    assert errors == []
    page.close()
