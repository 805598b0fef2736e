"""Real processes: a gateway on ports of its own, and a peer on its bus."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from tests.ports import unused_port

ROOT = Path(__file__).parents[2]
PATIENCE_S = 20.0


class RunningGateway:
    """`plumbline run` with its own data folder, bus and page."""

    def __init__(self, folder, toml="", page=False, arguments=(), prefix=(), environment=None):
        self.data_dir = folder / "data"
        self.bus_port, self.page_port = unused_port(), unused_port()
        self.endpoint = f"tcp/127.0.0.1:{self.bus_port}"
        config = folder / "gateway.toml"
        config.write_text(toml)
        settings = {
            "PLUMBLINE_GATEWAY__DATA_DIR": str(self.data_dir),
            "PLUMBLINE_BUS__LISTEN": json.dumps([self.endpoint]),
            "PLUMBLINE_PAGE__LISTEN": f"127.0.0.1:{self.page_port}",
            "PLUMBLINE_PAGE__ENABLED": json.dumps(page),
        }
        self.started_s = time.monotonic()
        self.process = subprocess.Popen(
            [*prefix, sys.executable, "-m", "gateway", "run", "--config", str(config), *arguments],
            cwd=ROOT,
            env={**os.environ, **settings, **(environment or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def wait(self, timeout_s=PATIENCE_S):
        """(exit code, standard output, standard error)."""
        out, err = self.process.communicate(timeout=timeout_s)
        return self.process.returncode, out, err

    def stop(self, name=signal.SIGTERM):
        """Signal it; (exit code, seconds that it took, standard error)."""
        self.process.send_signal(name)
        begun_s = time.monotonic()
        code, _, err = self.wait()
        return code, time.monotonic() - begun_s, err

    @property
    def recordings(self):
        return sorted(self.data_dir.glob("*.mcap"))


class BusPeer:
    """A second party on the bus that keeps what it hears."""

    def __init__(self, endpoint, key="plumbline/v1/**"):
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("connect/timeout_ms", "15000")
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.heard = []
        self._subscriber = self.session.declare_subscriber(key, self._hear)

    def _hear(self, sample):
        self.heard.append((time.time_ns(), str(sample.key_expr), sample.payload.to_bytes()))

    def messages(self, topic):
        return [json.loads(payload) for _, key, payload in list(self.heard) if key.endswith(f"/{topic}")]

    def wait_for(self, topic, wanted=lambda _: True, timeout_s=PATIENCE_S):
        """The first message of a topic that is wanted."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            for message in self.messages(topic):
                if wanted(message):
                    return message
            time.sleep(0.02)
        raise AssertionError(f"no such message of {topic} in {timeout_s} s; heard {len(self.heard)}")

    def close(self):
        self._subscriber.undeclare()
        self.session.close()


@pytest.fixture
def start_gateway(tmp_path):
    """Starts gateways that do not outlive the test."""
    running = []

    def start(*arguments, **options):
        running.append(RunningGateway(tmp_path, *arguments, **options))
        return running[-1]

    yield start
    for gateway in running:
        if gateway.process.poll() is None:
            gateway.process.kill()
        gateway.process.communicate()


@pytest.fixture
def join_bus():
    """Joins buses, and leaves them after the test."""
    peers = []

    def join(endpoint):
        peers.append(BusPeer(endpoint))
        return peers[-1]

    yield join
    for peer in peers:
        peer.close()


@pytest.fixture
def plumbline():
    """Runs a command to its end."""

    def run(*arguments, timeout_s=60.0, cwd=ROOT):
        return subprocess.run(
            [sys.executable, "-m", "gateway", *map(str, arguments)],
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )

    return run


@contextmanager
def listening_on(port):
    with socket.create_server(("127.0.0.1", port)):
        yield
