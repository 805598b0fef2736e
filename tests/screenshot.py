"""The pictures of the page: a gateway of its own, when all is well, and while a coming peak is announced."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.request import urlopen

from playwright.sync_api import Page, sync_playwright

from gateway.page.sign_in import PIN_NAME
from tests.benchmarks.chain import free_endpoint
from tests.waiting import wait_until

CHROMIUM = "/usr/bin/chromium"
SETTLED_S = 90.0
"""Time for which the trend has something to show."""
PATIENCE_S = 300.0
SWINGING_DEG = 1.0
"""Smallest angle of a picture: beside less, a load that swings looks like one at rest."""
STANDS = """([sentence, least_deg]) => document.getElementById('sentence').textContent.includes(sentence)
  && parseFloat(document.getElementById('phi').textContent) >= least_deg"""
ANSWERED_S = 2.0
"""Time in which an acknowledgement shows in the list."""
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
            _take(f"http://127.0.0.1:{port}/", Path(folder) / PIN_NAME, alert_path, calm_path)
        finally:
            gateway.terminate()
            gateway.wait()


def _take(address: str, pin_path: Path, alert_path: str, calm_path: str) -> None:
    """Take each picture once its sentence stands there, the calm one with all alarms acknowledged.

    Raises `playwright.sync_api.TimeoutError`.
    """
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(1000 * PATIENCE_S)
        wait_until(lambda: _is_served(address), "the page")
        page.goto(address)
        page.wait_for_timeout(1000 * SETTLED_S)
        _take_one(page, ANNOUNCED, alert_path)
        _acknowledge_all(page, pin_path.read_text().strip())
        _take_one(page, CALM, calm_path)
        browser.close()


def _take_one(page: Page, sentence: str, path: str) -> None:
    page.wait_for_function(STANDS, arg=[sentence, SWINGING_DEG])
    page.screenshot(path=path)


def _acknowledge_all(page: Page, pin: str) -> None:
    """Sign in and acknowledge, as a person does in the list."""
    page.locator("#to-alerts").click()
    button = page.locator("#alert-rows button").first
    button.click()
    page.locator("#sign-in-name").fill("Ann")
    page.locator("#sign-in-pin").fill(pin)
    page.keyboard.press("Enter")
    page.locator("#sign-in").wait_for(state="hidden")
    page.wait_for_timeout(1000 * ANSWERED_S)
    while button.is_visible():
        button.click()
        page.wait_for_timeout(1000 * ANSWERED_S)
    page.locator("#to-swing").click()


def _is_served(address: str) -> bool:
    try:
        with urlopen(address, timeout=2):
            return True
    except OSError:
        return False


if __name__ == "__main__":
    main(*sys.argv[1:3])
