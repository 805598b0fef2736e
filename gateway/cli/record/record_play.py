"""`plumbline record play`: recordings on the bus, at their pace or another."""

import argparse

from gateway.cli.options.argument_types import above_zero
from gateway.cli.options.bus_link import LOCAL_ENDPOINT
from gateway.cli.options.recording_options import add_selection, interval

EXAMPLE = """examples:
  plumbline record play plumbline-data --last 10:00 --speed 4
  plumbline record play incident.mcap --connect tcp/10.0.0.5:7447
  plumbline remote watch      (in another terminal)
  plumbline bridge foxglove --gateway plumbline/v1/yard/crane-1/hook-replayed      (for viewers)"""


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    play = verbs.add_parser(
        "play",
        help="publish recordings on the bus, at their pace or another",
        description="Publish recordings on the bus, at their pace or another. The keys have -replayed behind the sensor's name, "
        "and the clock of every message is `replayed`; the times are those of the recording. Long gaps are shortened.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_selection(play)
    play.add_argument(
        "--speed", type=above_zero, default=1.0, metavar="X", help="recorded seconds per second (default %(default)g)"
    )
    place = play.add_mutually_exclusive_group()
    place.add_argument(
        "--listen", default=LOCAL_ENDPOINT, metavar="ENDPOINT", help="where others may connect (default %(default)s)"
    )
    place.add_argument("--connect", metavar="ENDPOINT", help="address of a router, in place of --listen")
    play.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Play the recordings to their end, or until Ctrl-C."""
    from gateway.bus.client import CONNECT_MS
    from gateway.bus.session import open_session
    from gateway.cli.terminal.progress import ProgressBar
    from gateway.recording.export.playback import Playback, playback_key
    from gateway.recording.reading.catalogue import open_timeline

    timeline = open_timeline(arguments.paths)
    selection, key = timeline.select(interval(arguments)), playback_key(timeline)
    if arguments.connect is not None:
        session = open_session("client", [arguments.connect], [], connect_timeout_ms=CONNECT_MS)
    else:
        session = open_session("peer", [], [arguments.listen])
    try:
        playback = Playback(session, key, arguments.speed)
        print(f"playing on {key}/** at {arguments.connect or arguments.listen}", flush=True)
        with ProgressBar(f"playing {timeline.name}") as bar:
            playback.play(timeline, selection, bar.update)
    finally:
        session.close()
    print(f"{playback.published} messages published")
    return 0
