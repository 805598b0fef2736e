"""From a sample's time to the message at a second process, split into what waits where."""

import json
import tempfile
import time

import numpy as np

from gateway.stages.lowpass import LowPass
from tests.benchmarks.chain import RATE_HZ
from tests.benchmarks.daemon import Listener, start

SECONDS = 60.0
BLOCK = 32
STARTING_S = 1.0
"""Messages of the first second are left out: their samples waited for the threads to start."""


def main() -> None:
    """Print the split for alerts and for every tenth-of-a-second tilt."""
    listener = Listener()
    with tempfile.TemporaryDirectory() as folder:
        process = start(listener, folder)
        listener.first.wait(10)
        time.sleep(SECONDS)
        process.terminate()
        process.wait()
    listener.close()
    print(f"delay: {RATE_HZ} Hz, block {BLOCK}, {SECONDS:.0f} s, two processes over loopback, ms")
    print(f"  filter (group delay, 1 Hz, order 2)     {1e3 * LowPass(1.0, 2, RATE_HZ).delay_s():8.1f}")
    print(f"  block dwell (oldest sample of a block)  {1e3 * (BLOCK - 1) / RATE_HZ:8.1f}")
    print("  the rest: newest sample of the block -> callback in the other process")
    for topic in ("alert", "tilt", "swing"):
        rest_ms = _rest_ms(listener, topic)
        p50, p99 = np.percentile(rest_ms, [50, 99])
        print(f"    {topic:<8} p50 {p50:7.2f}  p99 {p99:7.2f}  max {rest_ms.max():7.2f}  of {len(rest_ms)}")


def _rest_ms(listener: Listener, topic: str) -> np.ndarray:
    heard = [(at_ns, json.loads(payload)) for at_ns, name, payload in listener.heard if name == topic]
    begin_ns = listener.heard[0][0] + STARTING_S * 1e9
    return np.array([(at_ns - message["time_ns"]) / 1e6 for at_ns, message in heard if at_ns > begin_ns])
