"""An observer beside the gateways, whom no fault touches: when each block of samples arrives, and what health says.

Arguments: file, endpoint of each gateway.
"""

import json
import sys
import time
from pathlib import Path

import zenoh

log = Path(sys.argv[1]).open("a", buffering=1)  # noqa: SIM115  (open until it is killed)


def note(sample: zenoh.Sample) -> None:
    """Write a line for each block of samples and each health message."""
    arrived_ns, message = time.time_ns(), json.loads(sample.payload.to_bytes())
    gateway, _, topic = str(sample.key_expr).rpartition("/")
    line = {
        "gateway": gateway,
        "topic": topic,
        "sequence": message["sequence"],
        "at_s": arrived_ns / 1e9,
        "delay_ms": (arrived_ns - message["time_ns"]) / 1e6,
    }
    if topic == "health":
        line |= {
            name: message[name] for name in ("boot_id", "lost", "dropped", "faults", "alert_latency_ms", "resident_mb")
        }
    print(json.dumps(line), file=log)


def watch(endpoint: str) -> zenoh.Session:
    """Return a session that notes what a gateway publishes; it comes back by itself when the gateway does."""
    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 60_000,
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    for topic in ("samples", "health"):
        session.declare_subscriber(f"plumbline/v1/**/{topic}", note)
    return session


sessions = [watch(endpoint) for endpoint in sys.argv[2:]]
while True:
    time.sleep(1.0)
