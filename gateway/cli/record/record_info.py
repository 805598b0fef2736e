"""`plumbline record info`: what is in recordings."""

import argparse

from gateway.cli.command import command
from gateway.cli.output import JSON_OPTION
from gateway.cli.recording_options import SELECTION_OPTIONS, interval
from gateway.errors import WITH_LOSSES

INFO_EXAMPLE = """examples:
  plumbline record info plumbline-data
  plumbline record info plumbline-data --last 1:00:00 --local
  plumbline record info plumbline-data/*.mcap --json -"""


@command(
    "info",
    "print what is in recordings: times, alerts, calibrations, gaps, faults, losses, topics",
    "Print what is in recordings: times, alerts from raised to cleared, changes of calibration and clock, gaps, "
    "faults, losses and topics. The segments of a gateway are one timeline; several gateways are printed one by one. Exit code "
    "3: something is missing, destroyed, altered or cannot be read.",
    INFO_EXAMPLE,
    *SELECTION_OPTIONS,
    JSON_OPTION,
)
def run_info(arguments: argparse.Namespace) -> int:
    """Print the content of the recordings."""
    from gateway.cli.output import show
    from gateway.cli.progress import ProgressBar
    from gateway.recording.export.info_text import info_text
    from gateway.recording.export.recording_info import summarise_timeline
    from gateway.recording.format.salvage import is_damaged
    from gateway.recording.reading.timeline import open_timelines

    chosen = interval(arguments)
    found = []
    for timeline in open_timelines(arguments.paths):
        with ProgressBar(f"reading {timeline.gateway}") as bar:
            found.append(summarise_timeline(timeline, chosen, bar.update))
    content = [info.as_json() for info in found] if len(found) > 1 else found[0].as_json()
    show("\n\n".join(info_text(info, is_local=arguments.local) for info in found), content, arguments.json)
    return WITH_LOSSES if any(info.hidden or is_damaged(info.losses) for info in found) else 0
