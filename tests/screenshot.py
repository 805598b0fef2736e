"""The pictures of the page: a gateway of its own, when all is well, and while a coming peak is announced."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any
from urllib.request import urlopen

from playwright.sync_api import sync_playwright

from tests.benchmarks.chain import free_endpoint

CHROMIUM = "/usr/bin/chromium"
SETTLED_S = 90.0
"""Time for which the trend has something to show."""
PATIENCE_S = 300.0
DIRECTIONS = {"plus_x": "trolley out", "minus_x": "trolley in", "plus_y": "bridge left", "minus_y": "bridge right"}


def main(calm_path: str, alert_path: str) -> None:
    """Run, wait, take the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        port = free_endpoint().rsplit(":", 1)[1]
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": folder,
            "PLUMBLINE_BUS__LISTEN": json.dumps([free_endpoint()]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{port}",
            **{f"PLUMBLINE_PAGE__DIRECTIONS__{axis.upper()}": name for axis, name in DIRECTIONS.items()},
        }
        gateway = subprocess.Popen([sys.executable, "-m", "gateway", "run", "--quiet"], env={**os.environ, **settings})
        try:
            address = f"http://127.0.0.1:{port}"
            _wait(address, _is_announced)
            _take(f"{address}/", alert_path)
            _wait(address, _is_calm)
            _take(f"{address}/", calm_path)
        finally:
            gateway.terminate()
            gateway.wait()


def _wait(address: str, wanted: Callable[[Any], bool]) -> None:
    """Return while a state is wanted and the trend has something to show. Raises `TimeoutError`."""
    begun_s = time.monotonic()
    while time.monotonic() - begun_s < PATIENCE_S:
        time.sleep(0.1)
        try:
            with urlopen(f"{address}/api/state", timeout=2) as answer:
                state = json.load(answer)
        except OSError:  # the page is not there yet
            continue
        uptime_s = state["topics"].get("health", {}).get("uptime_s", 0.0)
        if uptime_s > SETTLED_S and wanted(state):
            return
    raise TimeoutError(f"the wanted state did not come in {PATIENCE_S:.0f} s")


def _is_announced(state: Any) -> bool:
    """Return whether a trip is announced and its peak has not come yet."""
    motion = state["topics"].get("motion", {})
    present_deg, coming_deg = motion.get("angle_deg"), motion.get("predicted_phi_max_deg")
    is_coming = coming_deg is not None and present_deg is not None and coming_deg > 1.2 * present_deg
    return bool(is_coming and state["verdict"]["word"] == "TRIP")


def _is_calm(state: Any) -> bool:
    """Return whether all is well and the load swings."""
    return bool(state["verdict"]["word"] == "OK" and state["topics"].get("motion", {}).get("state") == "free")


def _take(address: str, path: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.wait_for_timeout(1500)
        page.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:3])
