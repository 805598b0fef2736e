"""A consumer as a user would write it: each event and the receiver's position in one line, so that a kill loses nothing.

Arguments: endpoint, file.
"""

import json
import os
import sys
import time
from pathlib import Path

from gateway.bus.alert_receiver import AlertReceiver

endpoint, log = sys.argv[1], Path(sys.argv[2])
kept = log.read_bytes() if log.exists() else b""
complete = kept[: kept.rfind(b"\n") + 1]
if complete != kept:  # killed in the middle of a line
    os.truncate(log, len(complete))
lines = complete.splitlines()
states = json.loads(lines[-1])["states"] if lines else "{}"
with log.open("ab", buffering=0) as file, AlertReceiver(endpoint, since=0, states=states) as receiver:
    for event in receiver:
        line = {"gateway": event.gateway, "at_ns": time.time_ns(), "states": receiver.states_json}
        if event.change is not None:
            line |= {
                "boot": event.change.boot_id,
                "number": event.change.alert_number,
                "event": event.change.event,
                "stored": event.change.stored,
                "sample_ns": event.change.time_ns,
            }
        elif event.missed is not None:
            line |= {"missed": [event.missed.first, event.missed.last]}
        else:
            line |= {"state": event.state}
        file.write(json.dumps(line).encode() + b"\n")
