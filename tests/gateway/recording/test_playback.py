"""Recordings on the bus."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh

from gateway import messages
from gateway.bus.authenticity import Authenticity
from gateway.bus.client import query_status
from gateway.bus.session import open_session
from gateway.cli.main import main
from gateway.recording.export.playback import MAX_PLAYED_GAP_S, MOST_AT_ONCE, Playback, ViewerPlayback, playback_key
from gateway.recording.reading.recording_file import EVERYTHING
from gateway.recording.reading.timeline import open_timeline
from gateway.topics import TOPICS
from tests.gateway.recording.recorded_crane import RecordedCrane
from tests.ports import unused_port
from tests.waiting import PATIENCE_S

KEY = "plumbline/v1/demo-site/crane-1/hook-1-replayed"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    crane = RecordedCrane(tmp_path_factory.mktemp("data"), segment_s=5.0)
    crane.record(8)
    return crane.close()


class PlayedTime:
    """Time that passes as fast as it is slept."""

    def __init__(self) -> None:
        self.now = 0.0

    def now_s(self) -> float:
        return self.now

    def sleep_s(self, seconds: float) -> None:
        self.now += seconds


def wait_for(condition: object) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end_s
        time.sleep(0.02)


@pytest.mark.slow
def test_every_published_topic_is_played_as_replayed_under_keys_of_its_own(recorded: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{unused_port()}"
    session, listener = open_session("peer", [], [endpoint]), open_session("client", [endpoint], [])
    heard: list[tuple[str, bytes]] = []
    subscriber = listener.declare_subscriber(
        "plumbline/v1/**", lambda sample: heard.append((str(sample.key_expr), sample.payload.to_bytes()))
    )
    try:
        timeline, played = open_timeline([recorded]), PlayedTime()
        playback = Playback(session, playback_key(timeline), 2.0, played.now_s, played.sleep_s)
        wait_for(lambda: list(listener.liveliness().get(f"{KEY}/alive", timeout=5.0)))
        probe = session.declare_publisher(f"{KEY}/motion")
        wait_for(lambda: probe.matching_status.matching)  # type: ignore[attr-defined]  # the subscription has arrived
        playback.play(timeline, EVERYTHING)
        wait_for(lambda: len(heard) == playback.published)
        (status,) = ask_while_waiting(playback, listener)
    finally:
        subscriber.undeclare()
        listener.close()
        session.close()
    assert played.now == pytest.approx(4.0, abs=0.2)
    keys = [key for key, _ in heard]
    assert set(keys) <= {f"{KEY}/{topic.name}" for topic in TOPICS.values() if topic.published}
    assert keys.count(f"{KEY}/samples") == keys.count(f"{KEY}/motion") == 80
    contents = [json.loads(payload) for _, payload in heard]
    assert {content["clock"] for content in contents} == {"replayed"}
    motion = next(content for key, content in zip(keys, contents, strict=True) if key.endswith("/motion"))
    assert set(motion) == set(messages.Motion.__dataclass_fields__)  # on the bus nothing is left out
    assert status["motion"]["clock"] == "replayed"


def ask_while_waiting(playback: Playback, listener: zenoh.Session) -> list[dict[str, dict[str, str]]]:
    """Ask for the status, while the playback waits."""
    answers: list[dict[str, dict[str, str]]] = []

    def ask() -> None:
        found = query_status(listener, "plumbline/v1/*/*/*", Authenticity()).values()
        answers.extend(answer.topics for answer in found)

    asking = threading.Thread(target=ask)
    asking.start()
    end_s = time.monotonic() + PATIENCE_S
    while asking.is_alive() and time.monotonic() < end_s:
        playback.answer_queries()
        time.sleep(0.02)
    asking.join()
    return answers


@pytest.mark.slow
def test_recording_of_no_gateway_is_refused(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    foreign = tmp_path / "full.mcap"
    assert main(["record", "export", str(recorded), "--mcap", str(foreign)]) == 0
    assert main(["record", "play", str(foreign)]) == 2
    assert "full.mcap: names no gateway; only recordings of the gateway can be played" in capsys.readouterr().err


def test_command_plays_to_the_end(recorded: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listen = f"tcp/127.0.0.1:{unused_port()}"
    assert main(["record", "play", str(recorded), "--speed", "1000", "--listen", listen, "--last", "3"]) == 0
    out = capsys.readouterr().out
    assert f"playing on {KEY}/** at {listen}" in out
    assert "messages published" in out


def test_viewers_get_each_message_when_it_is_due_and_as_it_is_recorded(recorded: Path) -> None:
    played, messages = PlayedTime(), list(open_timeline([recorded]).messages())
    playback = ViewerPlayback(messages, 2.0, played.now_s)
    assert (playback.take(), playback.is_at_end) == ([], False)
    playback.begin()
    taken: list[tuple[float, tuple[str, bytes, int]]] = []
    while not playback.is_at_end:
        played.sleep_s(0.02)
        taken += [(played.now, each) for each in playback.take()]
    assert [each for _, each in taken] == [
        (message.recorded.topic[1:], message.recorded.data, message.recorded.log_time_ns) for message in messages
    ]
    first_ns = taken[0][1][2]
    newest_ns = first_ns
    for now_s, (_, _, time_ns) in taken:
        newest_ns = max(newest_ns, time_ns)
        assert now_s == pytest.approx((newest_ns - first_ns) / 2e9, abs=0.05)
    assert playback.played == len(messages)


def test_a_long_gap_is_shortened_and_viewers_get_no_more_at_once_than_can_wait_for_them(recorded: Path) -> None:
    messages = list(open_timeline([recorded]).messages())
    first, last = messages[0], messages[-1]
    gap = replace(last, recorded=replace(last.recorded, log_time_ns=last.recorded.log_time_ns + 3600 * 10**9))
    played = PlayedTime()
    playback = ViewerPlayback([first, gap], 1.0, played.now_s)
    playback.begin()
    assert len(playback.take()) == 1
    played.now = MAX_PLAYED_GAP_S
    assert len(playback.take()) == 1
    fast = ViewerPlayback(messages, 1e6, played.now_s)
    fast.begin()
    played.now += 1.0
    assert len(fast.take()) == MOST_AT_ONCE


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--connect", "tcp/10.0.0.5:7447"], "--connect is for the bus: viewers connect to --listen"),
        (["--listen", "0.0.0.0:8765"], "--listen: 0.0.0.0:8765 is open to others"),
    ],
)
def test_viewers_are_served_on_this_machine_alone(
    recorded: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", "play", str(recorded), "--foxglove", *options]) == 2
    assert said in capsys.readouterr().err
