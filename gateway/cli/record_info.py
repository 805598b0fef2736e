"""`plumbline record info`: what is in a recording."""

import argparse

from gateway.cli.record_options import add_json, add_paths


def add_to(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verb."""
    info = verbs.add_parser(
        "info",
        help="print what is in a recording: times, topics, samples, losses, calibration, alerts",
        description="Print what is in a recording: times, topics, samples, losses, calibration and alerts.",
        epilog="example: plumbline record info plumbline-data/*.mcap --json info.json",
    )
    add_paths(info)
    add_json(info)
    info.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the content of the recordings."""
    from gateway.cli.output import show
    from gateway.recording.catalogue import list_recordings
    from gateway.recording.info import summarise
    from gateway.recording.info_text import info_text

    found = [summarise(path) for path in list_recordings(arguments.paths)]
    content = [info.as_json() for info in found] if len(found) > 1 else found[0].as_json()
    show("\n\n".join(info_text(info) for info in found), content, arguments.json)
    return 0
