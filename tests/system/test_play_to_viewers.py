"""A recording at a viewer: the topics, schemas and messages of the file at its pace, and the word that it is one."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from tests.gateway.recording.recorded_crane import RecordedCrane
from tests.ports import unused_port
from tests.system.conftest import ROOT
from tests.system.foxglove_client import FoxgloveClient
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.slow

RECORDED_S = 8
SPEED = 4.0


def test_a_viewer_gets_the_recording_at_its_pace_until_it_leaves(tmp_path: Path) -> None:
    crane = RecordedCrane(tmp_path / "data")
    crane.record(RECORDED_S)
    folder, port = crane.close(), unused_port()
    schemas: dict[str, tuple[str, str]] = {}
    contents: dict[str, list[Any]] = {}
    times_ns: dict[str, list[int]] = {}
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            schemas[channel.topic] = (schema.name, schema.data.decode())
            contents.setdefault(channel.topic, []).append(json.loads(message.data))
            times_ns.setdefault(channel.topic, []).append(message.log_time)
    command = ["record", "play", str(folder), "--foxglove", "--listen", f"127.0.0.1:{port}", "--speed", str(SPEED)]
    playing = subprocess.Popen(
        [sys.executable, "-m", "gateway", *command],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert playing.stdout is not None
        assert playing.stdout.readline().startswith(f"playing to viewers at ws://127.0.0.1:{port}, of plumbline/v1/")
        viewer = FoxgloveClient(port).subscribe()
        begun_s = time.monotonic()
        viewer.until(
            lambda: all(len(viewer.messages.get(topic, ())) >= len(sent) for topic, sent in contents.items()),
            RECORDED_S / SPEED + PATIENCE_S,
        )
        took_s = time.monotonic() - begun_s
        newest_ns = max(map(max, times_ns.values()))
        viewer.until(lambda: newest_ns in viewer.clock_ns)  # the library sends times and messages by two queues
        viewer.close()
        out, err = playing.communicate(timeout=PATIENCE_S)
    finally:
        playing.kill()
        playing.wait()
    assert (playing.returncode, err) == (0, "")
    assert f"{sum(map(len, contents.values()))} messages played" in out
    assert took_s > RECORDED_S / SPEED
    described = {topic: (each["schemaName"], each["schema"]) for topic, each in viewer.channels.items()}
    assert {topic: described[topic] for topic in schemas} == schemas
    for topic, sent in contents.items():
        assert viewer.messages[topic] == sent
        assert viewer.times_ns[topic] == times_ns[topic]
    assert viewer.clock_ns == sorted(viewer.clock_ns)
    assert viewer.clock_ns[-1] == newest_ns
    assert viewer.state == "replay"
    assert "a recording is replayed" in viewer.statuses["gateway"]["message"]
