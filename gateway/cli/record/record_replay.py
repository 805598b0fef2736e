"""`plumbline record replay` and `play`: recordings once more, computed again from raw samples, or published as they came."""

import argparse
import asyncio
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero, duration_s
from gateway.cli.bus_link import LOCAL_ENDPOINT
from gateway.cli.command import command, one_of, option
from gateway.cli.output import JSON_OPTION
from gateway.cli.recording_options import SELECTION_OPTIONS, interval
from gateway.errors import ANSWER_IS_NO, WITH_LOSSES
from gateway.extras import require_extra

if TYPE_CHECKING:
    from gateway.bridge.settings import FoxgloveSection
    from gateway.recording.reading.recording_file import Selection
    from gateway.recording.reading.timeline import Timeline

REPLAY_EXAMPLE = """examples:
  plumbline record replay plumbline-data
  plumbline record replay plumbline-data --from 07:30:00 --to 07:40:00 --warm-up 5:00
  plumbline record replay plumbline-data --calibration record.json --json -"""
SETTLED_S = 2.0
"""From the last topic that a viewer asks for to the first message. Basis: viewers ask panel by panel, for seconds."""
LOOK_S = 0.1
"""Time between two looks at the viewers. Basis: a choice; a person notices no later answer."""
PLAY_EXAMPLE = """examples:
  plumbline record play plumbline-data --foxglove --last 10:00      (for viewers)
  plumbline record play plumbline-data --last 10:00 --speed 4
  plumbline record play incident.mcap --connect tcp/10.0.0.5:7447
  plumbline remote watch      (in another terminal)"""


@command(
    "replay",
    "compute every result again from the raw samples, and compare it with the recorded one",
    "Compute every result again from the raw samples, with the recorded configuration and calibration, and "
    "compare it with the recorded one: byte for byte with the same software, NumPy and machine, within a stated "
    "tolerance elsewhere. With another calibration or configuration: a table of what it would have said. Exit code 1: "
    "something differs; 3: a segment is missing, something could not be read, a checksum is wrong, or nothing could be compared.",
    REPLAY_EXAMPLE,
    *SELECTION_OPTIONS,
    option("--calibration", type=Path, metavar="RECORD.json", help="another calibration record"),
    option("--config", type=Path, metavar="FILE.toml", help="another configuration"),
    option(
        "--warm-up",
        type=duration_s,
        metavar="D",
        help="begin this long before the part in place of at the start of the gateway's run, which takes long; the results "
        "are then compared within a tolerance",
    ),
    JSON_OPTION,
)
def run_replay(arguments: argparse.Namespace) -> int:
    """Replay the recordings; return 1 where something differs, 3 where not everything could be compared."""
    from gateway.calibration.input_files import read_record
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.configuration.loading import load
    from gateway.recording.reading.timeline import open_timeline
    from gateway.recording.replay.replay_result import has_difference, replay_json, replay_text
    from gateway.recording.replay.replay_run import ReplayRun

    configuration = None if arguments.config is None else load(arguments.config, {})
    record = None if arguments.calibration is None else read_record(arguments.calibration)
    timeline = open_timeline(arguments.paths)
    replay = ReplayRun(timeline, interval(arguments), configuration, record, arguments.warm_up)
    with ProgressBar(f"replaying {timeline.gateway}") as bar:
        result = replay.result(bar.update)
    show(replay_text(result, is_local=arguments.local), replay_json(result), arguments.json)
    if result.is_compared and has_difference(result):
        return ANSWER_IS_NO
    return WITH_LOSSES if result.has_losses else 0


@command(
    "play",
    "publish recordings on the bus, or show them to viewers, at their pace or another",
    "Publish recordings on the bus, at their pace or another. The keys have -replayed behind the sensor's name, "
    "and the clock of every message is `replayed`; the times are those of the recording. Long gaps are shortened. "
    "With --foxglove serve them to Foxglove, Lichtblick and other viewers on this machine instead, as they are recorded, "
    "from when a viewer has asked for its topics until the last viewer leaves.",
    PLAY_EXAMPLE,
    *SELECTION_OPTIONS,
    option(
        "--speed", type=above_zero, default=1.0, metavar="X", help="recorded seconds per second (default %(default)g)"
    ),
    option("--foxglove", action="store_true", help="serve viewers by the Foxglove WebSocket protocol, not the bus"),
    one_of(
        option(
            "--listen",
            metavar="ENDPOINT",
            help=f"where others may connect (default {LOCAL_ENDPOINT}; with --foxglove 127.0.0.1:8765)",
        ),
        option("--connect", metavar="ENDPOINT", help="address of a router, in place of --listen"),
    ),
)
def run_play(arguments: argparse.Namespace) -> int:
    """Play the recordings to their end, or until Ctrl-C."""
    from gateway.recording.reading.timeline import open_timeline

    section = _viewers_section(arguments) if arguments.foxglove else None
    timeline = open_timeline(arguments.paths)
    selection = timeline.select(interval(arguments))
    if section is not None:
        played = asyncio.run(_show(timeline, selection, section, arguments.speed))
        print(f"{played} messages played")
    else:
        _publish(timeline, selection, arguments)
    return 0


def _publish(timeline: "Timeline", selection: "Selection", arguments: argparse.Namespace) -> None:
    from gateway.bus.client import CONNECT_MS
    from gateway.bus.session import open_session
    from gateway.cli.progress import ProgressBar
    from gateway.recording.export.playback import Playback, playback_key

    key, listen = playback_key(timeline), arguments.listen or LOCAL_ENDPOINT
    if arguments.connect is not None:
        session = open_session("client", [arguments.connect], [], connect_timeout_ms=CONNECT_MS)
    else:
        session = open_session("peer", [], [listen])
    try:
        playback = Playback(session, key, arguments.speed)
        print(f"playing on {key}/** at {arguments.connect or listen}", flush=True)
        with ProgressBar(f"playing {timeline.name}") as bar:
            playback.play(timeline, selection, bar.update)
    finally:
        session.close()
    print(f"{playback.published} messages published")


def _viewers_section(arguments: argparse.Namespace) -> "FoxgloveSection":
    """Return where to serve viewers. Raises `InputError`."""
    require_extra("foxglove")
    from pydantic import ValidationError

    from gateway.bridge.settings import FoxgloveSection
    from gateway.errors import InputError, describe_problems

    if arguments.connect is not None:
        raise InputError(
            "--connect is for the bus: viewers connect to --listen; leave out one of --foxglove and --connect"
        )
    try:
        return FoxgloveSection() if arguments.listen is None else FoxgloveSection(listen=arguments.listen)
    except ValidationError as error:
        raise InputError("--" + "; ".join(describe_problems(error))) from error


async def _show(timeline: "Timeline", selection: "Selection", section: "FoxgloveSection", speed: float) -> int:
    """Play to viewers until the last one leaves; return the number of messages. Raises `InputError`, `RecordingError`."""
    from dataclasses import replace

    from gateway.bridge.foxglove_server import FoxgloveServer
    from gateway.bridge.plant_snapshot import PlantSnapshot, PlantState
    from gateway.cli.progress import ProgressBar
    from gateway.recording.export.playback import ViewerPlayback, playback_key
    from gateway.recording.format.content import schema_bytes
    from gateway.topics import paths_with

    key, wanted = playback_key(timeline), replace(selection, topics=paths_with(lambda topic: topic.logged))
    with ProgressBar(f"playing {timeline.name}") as bar:
        playback = ViewerPlayback(timeline.messages(wanted, bar.update), speed)
        server = FoxgloveServer(section, key, schema_bytes, lambda: PlantSnapshot(state=PlantState.REPLAY), playback)

        serving = asyncio.create_task(
            server.serve(lambda: print(f"playing to viewers at ws://{section.listen}, of {key}", flush=True))
        )
        subscriptions, has_begun, changed_s = 0, False, time.monotonic()
        while subscriptions or not playback.is_at_end:
            if server.viewers.subscriptions != subscriptions:
                subscriptions, changed_s = server.viewers.subscriptions, time.monotonic()
            if subscriptions and not has_begun and time.monotonic() - changed_s >= SETTLED_S:
                has_begun = True
                playback.begin()
            await asyncio.wait((serving,), timeout=LOOK_S)
            if serving.done():
                await serving  # raises what has ended it
        serving.cancel()
    return playback.played
