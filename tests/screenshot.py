"""The pictures of the page: a gateway of its own, when all is well, and while a coming peak is announced."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from urllib.request import urlopen

from playwright.sync_api import sync_playwright

from tests.benchmarks.chain import free_endpoint
from tests.waiting import wait_until

CHROMIUM = "/usr/bin/chromium"
SETTLED_S = 90.0
"""Time for which the trend has something to show."""
PATIENCE_S = 300.0
ANNOUNCED, CALM = "Limit 6.0° about to be exceeded.", "Load swings."
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
            _take(f"http://127.0.0.1:{port}/", {ANNOUNCED: alert_path, CALM: calm_path})
        finally:
            gateway.terminate()
            gateway.wait()


def _take(address: str, pictures: Mapping[str, str]) -> None:
    """Take each picture once its sentence stands there. Raises `playwright.sync_api.TimeoutError`."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(1000 * PATIENCE_S)
        wait_until(lambda: _is_served(address), "the page")
        page.goto(address)
        page.wait_for_timeout(1000 * SETTLED_S)
        for sentence, path in pictures.items():
            page.wait_for_function(
                "text => document.getElementById('sentence').textContent.includes(text)", arg=sentence
            )
            page.screenshot(path=path)
        browser.close()


def _is_served(address: str) -> bool:
    try:
        with urlopen(address, timeout=2):
            return True
    except OSError:
        return False


if __name__ == "__main__":
    main(*sys.argv[1:3])
