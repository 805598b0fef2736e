"""A Zenoh router in a process of its own, until it is killed."""

import json
import sys
import threading

import zenoh

config = zenoh.Config()
for key, value in {
    "mode": "router",
    "listen/endpoints": sys.argv[1:],
    "scouting/multicast/enabled": False,
    "transport/link/tx/lease": 1200,
    "transport/shared_memory/enabled": False,
}.items():
    config.insert_json5(key, json.dumps(value))
with zenoh.open(config):
    threading.Event().wait()
