"""From a sample to the change of an alert at a second process, split into dwell, gateway and transport, at 1 kHz."""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from gateway.bus.alert_receiver import AlertReceiver
from gateway.bus.authenticity import Authenticity
from gateway.bus.client import open_client_session, query_status
from gateway.pipeline.pipeline import UPDATE_PERIOD_S
from gateway.stages.lowpass import LowPass
from tests.system.conftest import RunningGateway

RATE_HZ, BLOCK = 1000, 10
SECONDS = 300.0
CHATTERING = f"""
[rope]
length_m = 0.8
[housing]
position_m = 0.56
[device]
odr_hz = {RATE_HZ}
block_samples = {BLOCK}
[alerts]
warn_deg = 7.2
trip_deg = 7.2
clear_deg = 7.2
hold_s = 0
"""
"""A short rope and no hysteresis: some 0.4 changes of alerts per second."""
FOLDERS = {"disk": "/var/tmp", "memory": "/dev/shm"}
"""The difference between the two is what the sync of the disk costs."""


def main() -> None:
    """Print the split."""
    print(f"alert latency: {RATE_HZ} Hz, blocks of {BLOCK}, {SECONDS:.0f} s each, two processes over loopback, ms")
    print(
        f"  filter of the swing: none beyond its samples; low-pass of the lean {1e3 * LowPass(1.0, 2, RATE_HZ).delay_s():.0f}"
    )
    dwell_ms = 1e3 * UPDATE_PERIOD_S
    print(
        f"  dwell of a sample until its block is complete and evaluated: 0 to {dwell_ms:.0f}, mean {dwell_ms / 2:.0f}"
    )
    for name, folder in FOLDERS.items():
        received_ms, own = _measure(folder)
        p50, p99 = np.percentile(received_ms, [50, 99])
        print(
            f"  outbox on {name}: newest sample -> callback  p50 {p50:.2f}  p99 {p99:.2f}  max {received_ms.max():.2f}",
            end="",
        )
        print(f"  of {len(received_ms)}; the gateway's own figure, until it is sent: {own}")


def _measure(folder: str) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the latencies of all changes at a receiver, and what the gateway states itself."""
    latencies_ms = []
    with tempfile.TemporaryDirectory(dir=folder) as data:
        gateway = RunningGateway(Path(data), CHATTERING)
        with AlertReceiver(gateway.endpoint) as receiver:
            end_s = time.monotonic() + SECONDS
            while time.monotonic() < end_s:
                for event in receiver.poll(0.1):
                    if event.change is not None:
                        latencies_ms.append((time.time_ns() - event.change.time_ns) / 1e6)
        with open_client_session(gateway.endpoint) as session:
            (status,) = query_status(session, "plumbline/v1/*/*/*", Authenticity()).values()
        gateway.stop()
    own: dict[str, Any] = status.topics["health"]["alert_latency_ms"]
    return np.array(latencies_ms[1:]), own  # the first one waits until the receiver knows the gateway
