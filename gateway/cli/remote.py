"""`plumbline remote`: read and control a gateway over the bus."""

import argparse
import sys

from gateway.cli.bus_link import add_address, connect_endpoint


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    from gateway.cli import align, remote_config, remote_fetch, remote_session, remote_status

    command = commands.add_parser(
        "remote",
        help="read and control a gateway over the bus: its state, its messages, its recalibration",
        description="Read and control a gateway over the bus: its state, its messages, its recalibration.",
        epilog="example: plumbline remote watch --topics swing,alert",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    watch = verbs.add_parser(
        "watch",
        help="print messages as they arrive, until Ctrl-C",
        description="Print messages as they arrive, one JSON object per line, until Ctrl-C.",
        epilog="example: plumbline remote watch --topics swing,alert",
    )
    watch.set_defaults(run=_watch)
    watch.add_argument(
        "--topics", default="swing,condition,alert", metavar="LIST", help="comma-separated topics (default %(default)s)"
    )
    watch.add_argument("--count", type=int, metavar="N", help="stop after N messages")
    status = remote_status.add_to(verbs)
    for verb in (status, watch, *remote_session.add_to(verbs), align.add_to(verbs), remote_fetch.add_to(verbs)):
        add_address(verb)
    remote_config.add_to(verbs)


def _watch(arguments: argparse.Namespace) -> int:
    import zenoh

    from gateway.bus.client import open_client_session
    from gateway.daemon.bounded_queue import BoundedQueue
    from gateway.errors import InputError
    from gateway.topics import TOPICS

    topics = [topic.strip() for topic in arguments.topics.split(",")]
    if unknown := [topic for topic in topics if topic not in TOPICS]:
        raise InputError(f"no topic {', '.join(unknown)}; the topics are {', '.join(TOPICS)}")
    samples: BoundedQueue[zenoh.Sample] = BoundedQueue(10_000)
    with open_client_session(connect_endpoint(arguments)) as session:
        subscribers = [session.declare_subscriber(f"{arguments.gateway}/{topic}", samples.put) for topic in topics]
        seen = 0
        while arguments.count is None or seen < arguments.count:
            sample = samples.get(timeout_s=1.0)
            if sample is None:
                continue
            sys.stdout.write(f'{{"key": "{sample.key_expr}", "message": {sample.payload.to_string()}}}\n')
            sys.stdout.flush()
            seen += 1
        for subscriber in subscribers:
            subscriber.undeclare()
    return 0
