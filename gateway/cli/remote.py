"""`plumbline remote`: read and control a gateway over the bus."""

import argparse

from gateway.cli.bus_link import add_address


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    from gateway.cli import align, remote_config, remote_fetch, remote_session, remote_status, remote_watch

    command = commands.add_parser(
        "remote",
        help="read and control a gateway over the bus: its state, its messages, its recalibration",
        description="Read and control a gateway over the bus: its state, its messages, its recalibration.",
        epilog="example: plumbline remote watch --topics swing,alert",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    status = remote_status.add_to(verbs)
    watch = remote_watch.add_to(verbs)
    for verb in (status, watch, *remote_session.add_to(verbs), align.add_to(verbs), remote_fetch.add_to(verbs)):
        add_address(verb)
    remote_config.add_to(verbs)
