"""`plumbline run` as a process among processes."""

import json
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from gateway.recording.reading.samples import read_samples
from gateway.topics import TOPICS
from gateway.verbs import VERBS
from tests.gateway.recording.recorded_files import summarise
from tests.system.bus_query import KEY, query
from tests.system.conftest import JoinBus, RunningGateway, StartGateway
from tests.values import present
from tests.waiting import wait_until

pytestmark = pytest.mark.slow

FAST = "[device]\nodr_hz = 1000\n"


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningGateway]:
    """A gateway for tests that only look at it."""
    gateway = RunningGateway(tmp_path_factory.mktemp("running"), FAST, page=True)
    yield gateway
    gateway.stop()


def test_every_topic_reaches_a_second_process(running: RunningGateway, join_bus: JoinBus) -> None:
    peer = join_bus(running.endpoint)
    for topic in ("samples", "tilt", "condition", "alert", "health", "swing"):
        message = peer.wait_for(topic)
        assert message["calibration_id"] == "factory-simulated-1-2g"
        assert message["clock"] in ("synchronised", "free_running")
        assert abs(message["time_ns"] - time.time_ns()) < 20e9
    sequences = [message["sequence"] for message in peer.messages("samples")]
    assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))


def test_is_alive_and_answers_a_status_query(running: RunningGateway, join_bus: JoinBus) -> None:
    peer = join_bus(running.endpoint)
    peer.wait_for("health")
    alive = [str(present(reply.ok).key_expr) for reply in peer.session.liveliness().get("plumbline/v1/**")]
    assert sorted(alive)[0] == f"{KEY}/alive"
    assert [token.startswith(f"{KEY}/alive/") for token in sorted(alive)[1:]] == [True]  # one more, with the boot's id
    (reply,) = peer.session.get("plumbline/v1/*/*/*/rpc/status")
    assert b'"health"' in present(reply.ok).payload.to_bytes()


def test_schemas_of_topics_and_requests_are_published(running: RunningGateway, join_bus: JoinBus) -> None:
    peer = join_bus(running.endpoint)
    peer.wait_for("health")
    ((_, listed),) = query(peer.session, "schema")
    published = {name for name, topic in TOPICS.items() if topic.published}
    assert set(listed["topics"]) == published
    assert set(listed["verbs"]) == set(VERBS)
    for topic in published:
        ((_, schema),) = query(peer.session, "schema", json.dumps({"topic": topic}).encode())
        assert schema["title"] == TOPICS[topic].schema_name
    ((_, refusal),) = query(peer.session, "schema", b'{"topic": "log"}')
    assert "no topic 'log' is published" in refusal["reason"]


@pytest.mark.parametrize("name", [signal.SIGTERM, signal.SIGINT])
def test_stops_cleanly_with_every_sample_on_disk(
    start_gateway: StartGateway, join_bus: JoinBus, name: signal.Signals
) -> None:
    gateway = start_gateway(FAST, page=True)
    peer = join_bus(gateway.endpoint)
    peer.wait_for("health", lambda message: message["samples"] > 1500)
    code, err = gateway.stop(name)
    assert [line for line in err.splitlines() if not line.startswith("INFO ")] == []
    assert code == 0
    (path,) = gateway.recordings
    info = summarise(path)
    assert info.closed
    assert (info.samples.lost, info.samples.gaps, info.samples.missing_blocks) == (0, 0, 0)
    heard = peer.wait_for("health", lambda message: message["state"] == "stopping")
    assert info.samples.count >= heard["samples"]


def test_kill_loses_at_most_the_sync_interval(start_gateway: StartGateway, join_bus: JoinBus) -> None:
    gateway = start_gateway(FAST + "[recorder]\nfsync_s = 2.0\n")
    peer = join_bus(gateway.endpoint)
    first_ns = peer.wait_for("samples")["time_ns"]
    peer.wait_for("samples", lambda message: message["time_ns"] > first_ns + 5.3e9)
    last_heard_ns = peer.messages("samples")[-1]["time_ns"]
    gateway.process.kill()
    gateway.process.wait()
    (path,) = gateway.recordings
    run = read_samples([path])
    assert (last_heard_ns - int(run.samples.time_ns[-1])) / 1e9 < 2 * 2.0  # a sync takes its time on a busy disk
    assert len(run.samples.time_ns) > 2000


def test_duration_ends_it(start_gateway: StartGateway) -> None:
    gateway = start_gateway(arguments=("--duration", "1.5"))
    code, out, err = gateway.wait()
    assert (code, err) == (0, "")
    assert time.monotonic() - gateway.started_s >= 1.5
    assert str(gateway.recordings[0]) in out
    assert gateway.endpoint in out


def test_nothing_listens_beyond_loopback(running: RunningGateway, join_bus: JoinBus) -> None:
    join_bus(running.endpoint).wait_for("health")
    _wait_for_page(running.page_port)
    pids = [running.process.pid, *_children(running.process.pid)]
    addresses = {address for pid in pids for address in _listening_addresses(pid)}
    assert addresses == {"0100007F"}  # 127.0.0.1


def _wait_for_page(port: int) -> None:
    wait_until(lambda: _answers(port), "an answer of the page")


def _answers(port: int) -> bool:
    try:
        with urlopen(f"http://127.0.0.1:{port}/", timeout=2) as answer:
            return bool(answer.status == HTTPStatus.OK)
    except (URLError, ConnectionError, TimeoutError):
        return False


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _listening_addresses(pid: int) -> Iterator[str]:
    """Local addresses, as the kernel prints them, of the process's listening TCP sockets and bound UDP sockets."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed meanwhile
            target = str(link.readlink())
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    for table, listening in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == listening and fields[9] in inodes:
                yield fields[1].split(":")[0]
