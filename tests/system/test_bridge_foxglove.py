"""Viewers of a gateway: the topics of its recordings, live, and at once the word that they no longer hold. Real processes."""

import json
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from gateway.topics import TOPICS
from tests.gateway.recording.test_viewer_layouts import LAYOUT
from tests.ports import unused_port
from tests.system.conftest import RunningGateway, StartGateway
from tests.system.foxglove_client import FoxgloveClient
from tests.system.running_bridge import RunningBridge
from tests.system.test_alert_delivery import CHATTERING

pytestmark = pytest.mark.slow

OpenViewer = Callable[[RunningGateway], tuple[RunningBridge, FoxgloveClient]]
GONE_S = 2.0


@pytest.fixture
def open_viewer(tmp_path: Path) -> Iterator[OpenViewer]:
    """Starts a bridge to a gateway, and connects a viewer."""
    ended: list[Callable[[], None]] = []

    def open_(gateway: RunningGateway) -> tuple[RunningBridge, FoxgloveClient]:
        port, settings = unused_port(), tmp_path / "bridge.toml"
        settings.write_text(f'demonstration = true\n[foxglove]\nlisten = "127.0.0.1:{port}"\n')
        bridge = RunningBridge("foxglove", gateway.endpoint, settings)
        ended.append(bridge.end)
        assert bridge.said.startswith(f"serving Foxglove viewers at ws://127.0.0.1:{port}")
        viewer = FoxgloveClient(port)
        ended.append(viewer.close)
        return bridge, viewer

    yield open_
    for end in ended:
        end()


def recorded(gateway: RunningGateway) -> tuple[dict[str, tuple[Any, ...]], dict[tuple[str, int], dict[str, Any]]]:
    """What a recording says of its topics, and its messages by topic and sequence number."""
    described: dict[str, tuple[Any, ...]] = {}
    messages: dict[tuple[str, int], dict[str, Any]] = {}
    for path in gateway.recordings:
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                assert schema is not None
                described[channel.topic] = (
                    channel.message_encoding,
                    schema.name,
                    schema.encoding,
                    schema.data.decode(),
                )
                content = json.loads(message.data)
                if "sequence" in content:
                    messages[channel.topic, content["sequence"]] = content
    return described, messages


def test_the_live_topics_have_the_schemas_and_the_messages_of_the_recording(
    start_gateway: StartGateway, open_viewer: OpenViewer
) -> None:
    gateway = start_gateway(CHATTERING)
    _, viewer = open_viewer(gateway)
    viewer.subscribe()
    viewer.until(
        lambda: all(viewer.messages.get(f"/{name}") for name in ("samples", "tilt", "motion", "health", "alert"))
    )
    viewer.until(lambda: viewer.state == "fine")
    assert viewer.statuses == {}
    assert gateway.stop()[0] == 0
    described, messages = recorded(gateway)
    live = {
        topic: (each["encoding"], each["schemaName"], each["schemaEncoding"], each["schema"])
        for topic, each in viewer.channels.items()
        if topic in described
    }
    assert set(viewer.channels) == {topic.path for topic in TOPICS.values() if topic.published} | {"/bridge"}
    assert live == {topic: each for topic, each in described.items() if topic in viewer.channels}
    assert len(live) >= 7
    for topic in (
        "/samples",
        "/motion",
        "/health",
    ):  # an alert has fields of the outbox, which the recording does not wait for
        both = [
            (each, messages[topic, each["sequence"]])
            for each in viewer.messages[topic]
            if (topic, each["sequence"]) in messages
        ]
        assert both
        assert [live for live, _ in both] == [kept for _, kept in both]


def test_a_viewer_learns_within_two_seconds_that_the_gateway_is_gone_and_forgets_what_it_has(
    start_gateway: StartGateway, open_viewer: OpenViewer
) -> None:
    gateway = start_gateway(CHATTERING)
    bridge, viewer = open_viewer(gateway)
    viewer.subscribe("/motion", "/bridge")
    viewer.until(lambda: viewer.state == "fine")
    n_sessions, channel = len(viewer.sessions), viewer.channels["/bridge"]["id"]
    gateway.process.send_signal(signal.SIGKILL)
    killed_s = time.monotonic()
    # its status says so even where the channel of the state is opened anew just as the viewer asks for it
    viewer.until(lambda: viewer.state in ("gateway gone", "link gone") or "gateway" in viewer.statuses)
    assert time.monotonic() - killed_s < GONE_S
    viewer.until(lambda: len(viewer.sessions) > n_sessions, timeout_s=GONE_S)
    # opened anew after the session: a viewer looks at the schemas again, which it has forgotten
    viewer.until(lambda: viewer.channels.get("/bridge", {"id": channel})["id"] != channel, timeout_s=GONE_S)
    viewer.until(lambda: "gateway" in viewer.statuses, timeout_s=GONE_S)
    assert viewer.statuses["gateway"]["level"] == 2
    n_messages = len(viewer.messages["/motion"])
    again = start_gateway(CHATTERING, environment={"PLUMBLINE_BUS__LISTEN": f'["{gateway.endpoint}"]'})
    viewer.until(lambda: viewer.state == "fine" and len(viewer.messages["/motion"]) > n_messages)
    viewer.until(lambda: "gateway" not in viewer.statuses)
    assert len(viewer.sessions) > n_sessions + 1  # the problem is over: not every viewer takes it back
    code, err = bridge.stop()
    assert (code, "WARNING" in err or "Traceback" in err) == (0, False), err
    assert again.stop()[0] == 0


def test_what_the_layout_lacks_live_is_what_the_guide_says() -> None:
    asked = {part for topic in TOPICS for part in (f"/{topic}",) if f'"{part}' in json.dumps(LAYOUT)}
    lacking = sorted(path for path in asked if not TOPICS[path[1:]].published)
    guide = (Path(__file__).parents[2] / "docs" / "guides" / "investigator" / "viewers" / "README.md").read_text()
    assert lacking == ["/acceleration", "/clock", "/log"]
    assert "`/acceleration`, `/clock` and `/log` are in recordings alone" in " ".join(guide.split())
