"""TCP ports for tests that run at the same time."""

import itertools
import os
import random
import socket

FIRST_PORT = 10_000
PORTS_PER_WORKER = 1_000
WORKERS = 22
"""All ports lie below 32768, where Linux begins to take the ports of outgoing connections."""


def _ports_of_this_worker() -> "itertools.cycle[int]":
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % WORKERS
    offsets = list(range(PORTS_PER_WORKER))
    start = random.randrange(PORTS_PER_WORKER)  # another run of the tests on this machine starts elsewhere
    return itertools.cycle(FIRST_PORT + PORTS_PER_WORKER * worker + k for k in offsets[start:] + offsets[:start])


_PORTS = _ports_of_this_worker()


def unused_port() -> int:
    """Return a port on which nobody listens and that no other test of this run is given."""
    for port in itertools.islice(_PORTS, PORTS_PER_WORKER):
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
    raise OSError(f"no unused port from {FIRST_PORT} on")
