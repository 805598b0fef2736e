"""`plumbline record replay`: the results of a recording, computed again from its raw samples."""

import argparse
from pathlib import Path

from gateway.cli.command import command, option
from gateway.cli.options.argument_types import duration_s
from gateway.cli.options.recording_options import add_selection, interval
from gateway.cli.terminal.output import add_json
from gateway.errors import ANSWER_IS_NO

EXAMPLE = """examples:
  plumbline record replay plumbline-data
  plumbline record replay plumbline-data --from 07:30:00 --to 07:40:00 --warm-up 5:00
  plumbline record replay plumbline-data --calibration record.json --json -"""


@command(
    "replay",
    "compute every result again from the raw samples, and compare it with the recorded one",
    "Compute every result again from the raw samples, with the recorded configuration and calibration, and "
    "compare it with the recorded one: byte for byte with the same software, NumPy and machine, within a stated "
    "tolerance elsewhere. With another calibration or configuration: a table of what it would have said. Exit code 1: "
    "something differs.",
    EXAMPLE,
    add_selection,
    option("--calibration", type=Path, metavar="RECORD.json", help="another calibration record"),
    option("--config", type=Path, metavar="FILE.toml", help="another configuration"),
    option(
        "--warm-up",
        type=duration_s,
        metavar="D",
        help="begin this long before the part in place of at the start of the gateway's run, which takes long; the results "
        "are then compared within a tolerance",
    ),
    add_json,
)
def run_replay(arguments: argparse.Namespace) -> int:
    """Replay the recordings; return 1 where something differs."""
    from gateway.calibration.input_files import read_record
    from gateway.cli.terminal.output import show
    from gateway.cli.terminal.progress import ProgressBar
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
    return ANSWER_IS_NO if has_difference(result) else 0
