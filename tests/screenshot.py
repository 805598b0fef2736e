"""The picture of the page in the README: a gateway of its own, watched until the load swings and the reading is trusted."""

import json
import os
import subprocess
import sys
import tempfile
import time
from urllib.error import URLError
from urllib.request import urlopen

from playwright.sync_api import sync_playwright

from tests.benchmarks.chain import free_endpoint

CHROMIUM = "/usr/bin/chromium"
SETTLED_S = 50.0
STEADY_S = 4.0
PATIENCE_S = 300.0
WANTED = "OK"


def main(path: str) -> None:
    """Run, wait, take the picture."""
    with tempfile.TemporaryDirectory() as folder:
        port = free_endpoint().rsplit(":", 1)[1]
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": folder,
            "PLUMBLINE_BUS__LISTEN": json.dumps([free_endpoint()]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{port}",
        }
        gateway = subprocess.Popen([sys.executable, "-m", "gateway", "run", "--quiet"], env={**os.environ, **settings})
        try:
            _wait(f"http://127.0.0.1:{port}")
            _take(f"http://127.0.0.1:{port}/", path)
        finally:
            gateway.terminate()
            gateway.wait()


def _wait(address: str) -> None:
    begun_s = time.monotonic()
    steady_since_s = begun_s + SETTLED_S
    while time.monotonic() - begun_s < PATIENCE_S:
        time.sleep(0.2)
        try:
            with urlopen(f"{address}/api/state", timeout=2) as answer:
                state = json.load(answer)
        except (URLError, ConnectionError):
            continue
        swing = state["topics"].get("swing", {})
        if state["verdict"]["word"] != WANTED or not swing.get("swinging"):
            steady_since_s = max(steady_since_s, time.monotonic())
        if time.monotonic() - steady_since_s > STEADY_S:
            return
    raise TimeoutError(f"the page was not {WANTED} for {STEADY_S:.0f} s on end in {PATIENCE_S:.0f} s")


def _take(address: str, path: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.wait_for_timeout(1500)
        page.screenshot(path=path)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1])
