"""What the daemon costs by sample rate, with the page off, on, and watched.

script/bench footprint [--runs N] [--against FOLDER]: FOLDER is another source tree, measured in turn with this one.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from urllib.request import urlopen

from tests.benchmarks.chain import free_endpoint
from tests.benchmarks.daemon import Listener
from tests.benchmarks.process_use import cpu_s, resident_mib

SETTLE_S, MEASURE_S = 5.0, 8.0
RATES_HZ = (100, 1000)
PAGES = ("off", "on", "watched")
START_S = 60.0
ROOT = Path(__file__).parents[2]


@dataclass
class Figures:
    """The figures of one tree, by run."""

    first_sample_s: list[float] = field(default_factory=list)
    start_cpu_s: list[float] = field(default_factory=list)
    """CPU time until the first sample is published; on a busy computer it is a better measure than the time."""
    resident_mib: list[float] = field(default_factory=list)
    cpu_percent: list[float] = field(default_factory=list)


def main(options: Sequence[str] = ()) -> None:
    """Print the figures; against another tree, those of this one over those of the other as well."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--against", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    chosen = parser.parse_args(options)
    other = chosen.against
    trees = [ROOT] if other is None else [other.absolute(), ROOT]
    load = os.getloadavg()[0]
    print(f"footprint: simulated crane, {chosen.runs} runs each in turn, medians; load {load:.0f}")
    for rate_hz in RATES_HZ:
        for page in PAGES:
            figures = {tree: Figures() for tree in trees}
            for _ in range(chosen.runs):
                for tree in trees:
                    _measure(tree, rate_hz, page, figures[tree])
            for tree in trees:
                _print(f"{rate_hz} Hz, page {page}, {tree.name}", figures[tree])
            if len(trees) > 1:
                _print_ratio(figures[trees[0]], figures[trees[-1]])


def _measure(tree: Path, rate_hz: int, page: str, figures: Figures) -> None:
    port = int(free_endpoint().rsplit(":", 1)[1])
    listener = Listener()
    with tempfile.TemporaryDirectory() as folder:
        settings = {
            "PYTHONPATH": str(tree),
            "PLUMBLINE_GATEWAY__DATA_DIR": folder,
            "PLUMBLINE_BUS__LISTEN": "[]",
            "PLUMBLINE_BUS__CONNECT": json.dumps([listener.endpoint]),
            "PLUMBLINE_PAGE__ENABLED": json.dumps(page != "off"),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{port}",
            "PLUMBLINE_DEVICE__ODR_HZ": str(rate_hz),
        }
        begun_s = time.monotonic()
        command = [sys.executable, "-m", "gateway", "run", "--quiet"]
        process = subprocess.Popen(command, cwd=tree, env={**os.environ, **settings}, stderr=subprocess.DEVNULL)
        try:
            if not listener.first.wait(START_S):
                raise TimeoutError("the gateway publishes nothing")
            figures.first_sample_s.append(time.monotonic() - begun_s)
            figures.start_cpu_s.append(cpu_s(process.pid))
            if page == "watched":
                address = f"http://127.0.0.1:{port}/api/events"
                threading.Thread(target=_watch, args=(address,), daemon=True).start()
            time.sleep(SETTLE_S)
            before_s = cpu_s(process.pid)
            time.sleep(MEASURE_S)
            figures.cpu_percent.append(100 * (cpu_s(process.pid) - before_s) / MEASURE_S)
            figures.resident_mib.append(resident_mib(process.pid))
        finally:
            process.terminate()
            process.wait()
            listener.close()


def _watch(address: str) -> None:
    """Read the live updates as a browser does, until the page ends."""
    end_s = time.monotonic() + START_S
    while time.monotonic() < end_s:
        with suppress(OSError), urlopen(address, timeout=10) as stream:
            while stream.readline():
                pass
        time.sleep(0.2)


def _print(name: str, figures: Figures) -> None:
    texts = [
        f"{label} {statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f}) {unit}"
        for label, values, unit in (
            ("first sample", figures.first_sample_s, "s"),
            ("CPU until then", figures.start_cpu_s, "s"),
            ("resident", figures.resident_mib, "MiB"),
            ("CPU", figures.cpu_percent, "% of a core"),
        )
    ]
    print(f"  {name:<32} " + "; ".join(texts), flush=True)


def _print_ratio(first: Figures, last: Figures) -> None:
    pairs = (
        ("first sample", first.first_sample_s, last.first_sample_s),
        ("CPU until then", first.start_cpu_s, last.start_cpu_s),
        ("resident", first.resident_mib, last.resident_mib),
        ("CPU", first.cpu_percent, last.cpu_percent),
    )
    texts = [f"{label} {statistics.median(b) / statistics.median(a):.2f}" for label, a, b in pairs]
    print(f"  {'last over first':<32} " + "; ".join(texts), flush=True)
