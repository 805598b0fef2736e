"""The server for viewers: a stalled one holds nobody up, drops are counted, and nobody else is let in."""

import asyncio
import contextlib
import json
import socket
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.bridge.foxglove_server import LIVE_TOPICS, MOST_WAITING, FoxgloveServer, LiveMessages
from gateway.bridge.heard_messages import READ_TOPICS
from gateway.bridge.plant_snapshot import PlantSnapshot, PlantState
from gateway.bridge.settings import FoxgloveSection
from gateway.cli.main import main
from gateway.errors import BAD_INPUT, InputError
from gateway.messages import ActiveAlert
from gateway.recording.format.content import encode_recorded, schema_bytes
from gateway.topics import encode
from tests.gateway.bridge.conftest import KEY
from tests.gateway.scene import Scene
from tests.ports import unused_port
from tests.system.foxglove_client import FoxgloveClient

N_LARGE = 400


def test_what_the_state_is_judged_by_is_among_the_live_topics() -> None:
    assert set(READ_TOPICS) <= set(LIVE_TOPICS)


def test_the_queue_drops_the_oldest_and_counts_them() -> None:
    messages = LiveMessages(encode_recorded)
    for number in range(MOST_WAITING + 3):
        messages.put(f"{KEY}/alert", encode(replace(Scene().alert(), sequence=number)), 0.0, live=True)
    messages.put(f"{KEY}/alert", encode(Scene().alert()), 0.0, live=False)
    messages.put(f"{KEY}/alert", b"{}", 0.0, live=True)
    assert messages.dropped == 4
    taken = messages.take()
    assert [json.loads(content)["sequence"] for _, content, _ in taken] == list(range(4, MOST_WAITING + 3))
    assert (messages.take(), messages.invalid) == ([], 1)


@pytest.mark.slow
def test_a_stalled_viewer_does_not_hold_up_another_and_invalid_messages_are_counted() -> None:
    port, messages = unused_port(), LiveMessages(encode_recorded)
    server = FoxgloveServer(
        FoxgloveSection(listen=f"127.0.0.1:{port}"),
        KEY,
        schema_bytes,
        lambda: PlantSnapshot(state=PlantState.FINE),
        messages,
    )

    async def flood() -> FoxgloveClient:
        serving = asyncio.create_task(server.serve(lambda: None))
        await asyncio.sleep(0.1)
        viewers = []
        for receive_bytes in (2048, None):
            viewer = await asyncio.to_thread(FoxgloveClient, port, receive_bytes=receive_bytes)
            viewers.append(await asyncio.to_thread(viewer.subscribe, "/alert", "/bridge"))
        stalled, reading = viewers
        await asyncio.sleep(0.1)
        messages.put(f"{KEY}/alert", b"{}", 0.0, live=True)
        active = ActiveAlert(rule="swing", level="warn", since_ns=0, text="x" * 60_000)
        alert = replace(Scene().alert(), active=[active])
        for number in range(N_LARGE):  # 24 MB: beyond every buffer of the system
            messages.put(f"{KEY}/alert", encode(replace(alert, sequence=number)), 0.0, live=True)
            if number % 20 == 19:
                await asyncio.to_thread(_read_until, reading, number)
        await asyncio.to_thread(reading.until, lambda: reading.messages["/bridge"][-1]["invalid"] == 1)
        serving.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await serving
        stalled.close()
        reading.close()
        return reading

    reading = asyncio.run(flood())
    assert [each["sequence"] for each in reading.messages["/alert"]] == list(range(N_LARGE))


def _read_until(viewer: FoxgloveClient, sequence: int) -> None:
    viewer.until(lambda: viewer.messages.get("/alert", [{"sequence": None}])[-1]["sequence"] == sequence)


def test_an_address_in_use_is_told_in_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        section = FoxgloveSection(listen=f"127.0.0.1:{taken.getsockname()[1]}")
        server = FoxgloveServer(
            section, KEY, schema_bytes, lambda: PlantSnapshot(state=PlantState.FINE), LiveMessages(encode_recorded)
        )
        with pytest.raises(InputError, match=r"cannot be used .*in use.*; change foxglove.listen"):
            asyncio.run(server.serve(lambda: None))


@pytest.mark.slow
@pytest.mark.parametrize("address", ["0.0.0.0:8765", "10.0.0.5:8765", "[::]:8765", "gateway:8765"])
def test_nobody_on_another_machine_is_served(address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = tmp_path / "bridge.toml"
    settings.write_text(f'[foxglove]\nlisten = "{address}"\n')
    arguments = ("--settings", str(settings), "--gateway", KEY, "--connect", "tcp/127.0.0.1:1")
    assert main(["bridge", "foxglove", *arguments]) == BAD_INPUT
    said = capsys.readouterr().err
    assert f"foxglove.listen: {address} is open to others, and the protocol's library knows no tokens" in said
    assert said.count("\n") == 1
