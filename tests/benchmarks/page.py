"""The page: time from the newest sample of a motion message to the browser's picture, and what 20 browsers cost the sampling."""

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from playwright.sync_api import sync_playwright

from tests.benchmarks.chain import free_endpoint

CHROMIUM = "/usr/bin/chromium"
ODR_HZ = 1000
SETTLE_S = 15.0
WATCH_S = 60.0
BROWSERS = 20
WATCH = """() => {
  window.delaysMs = [];
  new MutationObserver(() => {
    const sampleMs = Number(document.body.dataset.sampleMs);
    const changedMs = performance.timeOrigin + performance.now();
    requestAnimationFrame(() => requestAnimationFrame(() => {
      window.delaysMs.push([changedMs - sampleMs, performance.timeOrigin + performance.now() - sampleMs]);
    }));
  }).observe(document.body, {attributes: true, attributeFilter: ['data-sample-ms']});
}"""


@dataclass(frozen=True, slots=True)
class Counts:
    """Counters of the gateway at one time."""

    at_s: float
    samples: int
    lost: int
    dropped: int
    cpu_s: float
    page_cpu_s: float


class Gateway:
    """`plumbline run` with the page at 1 kHz."""

    def __init__(self, folder: str) -> None:
        self.address = free_endpoint().removeprefix("tcp/")
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": folder,
            "PLUMBLINE_BUS__LISTEN": json.dumps([free_endpoint()]),
            "PLUMBLINE_PAGE__LISTEN": self.address,
            "PLUMBLINE_DEVICE__ODR_HZ": str(ODR_HZ),
        }
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gateway", "run", "--quiet"],
            env={**os.environ, **settings},
            stderr=subprocess.DEVNULL,
        )

    def state(self) -> Any:
        """What the page knows."""
        with urlopen(f"http://{self.address}/api/state", timeout=10) as answer:
            return json.load(answer)

    def wait(self) -> None:
        """Return once health is published."""
        for _ in range(600):
            with contextlib.suppress(OSError):
                if "health" in self.state()["topics"]:
                    return
            time.sleep(0.1)
        raise TimeoutError("the page does not answer")

    def counts(self) -> Counts:
        """The present counters."""
        health = self.state()["topics"]["health"]
        children = _children(self.process.pid)
        return Counts(
            at_s=health["uptime_s"],
            samples=health["samples"],
            lost=health["lost"],
            dropped=sum(health["dropped"].values()),
            cpu_s=_cpu_s(self.process.pid),
            page_cpu_s=sum(map(_cpu_s, children)),
        )


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def browsers(address: str, count: int) -> Iterator[list[int]]:
    """Readers of the event stream, as browsers are; the number of bytes that each has read."""
    ended = threading.Event()
    read = [0] * count

    def follow(number: int) -> None:
        with urlopen(f"http://{address}/api/events", timeout=10) as stream:
            while not ended.is_set():
                read[number] += len(stream.readline())

    threads = [threading.Thread(target=follow, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    try:
        yield read
    finally:
        ended.set()
        for thread in threads:
            thread.join()


def main() -> None:
    """Print the delays, and the counters without and with browsers."""
    load = os.getloadavg()[0]
    print(f"page: {ODR_HZ} Hz, load of the machine {load:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        gateway = Gateway(folder)
        try:
            gateway.wait()
            time.sleep(SETTLE_S)
            _print_cost(gateway, 0)
            _print_cost(gateway, BROWSERS)
            _print_delays(gateway)
        finally:
            gateway.process.terminate()
            gateway.process.wait()


def _print_cost(gateway: Gateway, count: int) -> None:
    before = gateway.counts()
    with browsers(gateway.address, count) as read:
        time.sleep(WATCH_S)
        after = gateway.counts()
        slowest = min(read, default=0)
    span_s = after.at_s - before.at_s
    print(
        f"{count:3d} browsers: {(after.samples - before.samples) / span_s:8.1f} Hz, lost {after.lost - before.lost}, "
        f"dropped {after.dropped - before.dropped}, CPU gateway {100 * (after.cpu_s - before.cpu_s) / span_s:.1f} %, "
        f"page {100 * (after.page_cpu_s - before.page_cpu_s) / span_s:.1f} %"
        + (f", the slowest browser got {slowest / WATCH_S / 1e3:.0f} kB/s" if count else "")
    )


def _print_delays(gateway: Gateway) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 800, "height": 480})
        page.goto(f"http://{gateway.address}/")
        page.wait_for_timeout(3000)
        page.evaluate(WATCH)
        page.wait_for_timeout(1e3 * WATCH_S)
        delays = page.evaluate("window.delaysMs")
        browser.close()
    for name, column in (("sample to changed document", 0), ("sample to picture", 1)):
        values = sorted(row[column] for row in delays)
        cuts = statistics.quantiles(values, n=100)
        print(
            f"{name}: p50 {cuts[49]:.0f} ms, p99 {cuts[98]:.0f} ms, largest {values[-1]:.0f} ms, {len(values)} messages"
        )
