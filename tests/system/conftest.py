"""Real processes: a gateway on ports of its own, and a peer on its bus."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Protocol

import pytest
import zenoh

from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from tests.ports import unused_port
from tests.system.forked_program import ForkedProgram
from tests.waiting import PATIENCE_S

ROOT = Path(__file__).parents[2]
LONGEST_STOP_S = 10.0
"""From a signal to the end: TimeoutStopSec of the service, after which it is killed."""
HOSTILE = """
import json, sys, time, zenoh
config = zenoh.Config()
for key, value in {{"mode": "client", "connect/endpoints": [sys.argv[1]], "scouting/multicast/enabled": False}}.items():
    config.insert_json5(key, json.dumps(value))
session = zenoh.open(config)
print("ready", flush=True)
{work}
"""


class RunningGateway:
    """`plumbline run` with its own data folder, bus and page."""

    def __init__(
        self,
        folder: Path,
        toml: str = "",
        page: bool = False,
        arguments: Sequence[str] = (),
        prefix: Sequence[str] = (),
        program: Sequence[str] = ("gateway",),
        environment: Mapping[str, str] | None = None,
        stdout: int = subprocess.PIPE,
        stderr: int = subprocess.PIPE,
    ) -> None:
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
        words = [*program, "run", "--config", str(config), *arguments]
        env = {**os.environ, **settings, **(environment or {})}
        self.process: ForkedProgram | subprocess.Popen[str]
        if prefix:
            command = [*prefix, sys.executable, "-m", *words]
            self.process = subprocess.Popen(command, cwd=ROOT, env=env, stdout=stdout, stderr=stderr, text=True)
        else:
            self.process = ForkedProgram(words, ROOT, env, stdout, stderr)

    def wait(self, timeout_s: float = PATIENCE_S) -> tuple[int, str, str]:
        """(exit code, standard output, standard error)."""
        out, err = self.process.communicate(timeout=timeout_s)
        return self.process.wait(), out, err

    def stop(self, name: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
        """Signal it, and it ends in time; (exit code, standard error)."""
        self.process.send_signal(name)
        begun_s = time.monotonic()
        code, _, err = self.wait()
        assert time.monotonic() - begun_s < LONGEST_STOP_S
        return code, err

    @property
    def recordings(self) -> list[Path]:
        return sorted(self.data_dir.glob("*.mcap"))


class BusPeer:
    """A second party on the bus that keeps what it hears."""

    def __init__(self, endpoint: str, key: str = "plumbline/v1/**") -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("connect/timeout_ms", str(round(1e3 * PATIENCE_S)))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.heard: list[tuple[int, str, bytes]] = []
        self._news = threading.Condition()
        self._subscriber = self.session.declare_subscriber(key, self._hear)

    def _hear(self, sample: zenoh.Sample) -> None:
        with self._news:
            self.heard.append((time.time_ns(), str(sample.key_expr), sample.payload.to_bytes()))
            self._news.notify_all()

    def messages(self, topic: str) -> list[Any]:
        return [json.loads(payload) for _, key, payload in list(self.heard) if key.endswith(f"/{topic}")]

    def wait_for(
        self, topic: str, wanted: Callable[[Any], object] = lambda _: True, timeout_s: float = PATIENCE_S
    ) -> Any:
        """The first message of a topic that is wanted."""
        deadline = time.monotonic() + timeout_s
        seen = 0
        while True:
            with self._news:
                while len(self.heard) == seen:
                    left_s = deadline - time.monotonic()
                    assert left_s > 0, f"no such message of {topic} in {timeout_s} s; heard {seen}"
                    self._news.wait(left_s)
                news, seen = self.heard[seen:], len(self.heard)
            for _, key, payload in news:
                if key.endswith(f"/{topic}") and wanted(message := json.loads(payload)):
                    return message

    def close(self) -> None:
        self._subscriber.undeclare()
        self.session.close()


def health(peer: BusPeer, after_s: float = 1.5, least_refused: int = 0) -> Any:
    """A health message that describes what comes from now on, with so many refusals at least."""
    begun_ns = time.time_ns() + round(after_s * 1e9)
    return peer.wait_for(
        "health",
        lambda message: message["time_ns"] > begun_ns and sum(message["refused"].values()) >= least_refused,
    )


StartGateway = Callable[..., RunningGateway]
"""Starts a gateway with the arguments of `RunningGateway` but the folder."""
JoinBus = Callable[[str], BusPeer]
Hostile = Callable[[str, str], "subprocess.Popen[str]"]
"""Starts a process that works on the bus at an endpoint."""


Completed = subprocess.CompletedProcess[str]


class Plumbline(Protocol):
    """Run a command to its end."""

    def __call__(self, *arguments: str | Path, environment: Mapping[str, str | None] | None = None) -> Completed: ...


@pytest.fixture
def start_gateway(tmp_path: Path) -> Iterator[StartGateway]:
    """Starts gateways that do not outlive the test."""
    running: list[RunningGateway] = []

    def start(*arguments: Any, **options: Any) -> RunningGateway:
        running.append(RunningGateway(tmp_path, *arguments, **options))
        return running[-1]

    yield start
    for gateway in running:
        if gateway.process.poll() is None:
            gateway.process.kill()
        gateway.process.communicate()


@pytest.fixture
def join_bus() -> Iterator[JoinBus]:
    """Joins buses, and leaves them after the test."""
    peers: list[BusPeer] = []

    def join(endpoint: str) -> BusPeer:
        peers.append(BusPeer(endpoint))
        return peers[-1]

    yield join
    for peer in peers:
        peer.close()


@pytest.fixture
def plumbline() -> Plumbline:
    """Runs commands in this process: to start another takes longer than most of them."""

    def run(*arguments: str | Path, environment: Mapping[str, str | None] | None = None) -> Completed:
        words, out, err = [str(each) for each in arguments], StringIO(), StringIO()
        with pytest.MonkeyPatch.context() as patched, redirect_stdout(out), redirect_stderr(err):
            for name, value in (environment or {}).items():
                patched.delenv(name, raising=False) if value is None else patched.setenv(name, value)
            try:
                code = main(words)
            except SystemExit as end:  # of the argument parser, which has printed why
                code = end.code if isinstance(end.code, int) else BAD_INPUT
        return Completed(words, code, out.getvalue(), err.getvalue())

    return run


def run_process(*arguments: str | Path) -> Completed:
    """Run a command in a process of its own, where that is what is tested."""
    return subprocess.run(
        [sys.executable, "-m", "gateway", *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE_S,
        check=False,
    )


@pytest.fixture
def hostile() -> Iterator[Hostile]:
    """Starts processes without any credential that do some work on the bus, with a `session`."""
    running: list[subprocess.Popen[str]] = []

    def start(endpoint: str, work: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", HOSTILE.format(work=work), endpoint]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT))
        assert running[-1].stdout is not None
        assert running[-1].stdout.readline() == "ready\n"
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


@contextmanager
def listening_on(port: int) -> Iterator[None]:
    with socket.create_server(("127.0.0.1", port)):
        yield
