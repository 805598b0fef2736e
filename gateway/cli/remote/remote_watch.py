"""`plumbline remote watch`: messages as they arrive, alerts each once and in order."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.bus_link import ADDRESS_OPTIONS, client_credentials, connect_endpoint
from gateway.cli.command import command, option
from gateway.errors import printable

if TYPE_CHECKING:
    import zenoh

    from gateway.bus.alert_receiver import AlertReceiver
    from gateway.bus.alert_sequence import AlertEvent
    from gateway.bus.authenticity import Authenticity, Doubt
    from gateway.daemon.runtime.worker import BoundedQueue

    Arrival = tuple[zenoh.Sample, float]
    """A message, and when it came on the monotonic clock."""

ALERT = "alert"
Line = dict[str, Any] | None
"""None: nothing has come."""
MAX_WAITING_MESSAGES = 10_000
"""Messages that may wait. Basis: a choice; minutes of all topics, and a bound of the memory."""
MAX_GREETING_S = 1.0
"""Longest wait for gateways at the start. Basis: a choice; they answer in milliseconds; one that hangs may not hold up others."""
MAX_OUTPUT_WAIT_S = 0.1
"""Longest wait before the output is written. Basis: a choice; ten times a second, as tilts come."""


@command(
    "watch",
    "print messages as they arrive, until Ctrl-C",
    "Print messages as they arrive, one JSON object per line, until Ctrl-C. Of the alerts each change is printed "
    "once and in order, also after the link was lost, and what is known of the gateway when that changes.",
    "example: plumbline remote watch --topics swing,alert\n"
    "         plumbline remote watch --topics alert --resume alerts.json",
    option(
        "--topics", default="swing,condition,alert", metavar="LIST", help="comma-separated topics (default %(default)s)"
    ),
    option("--count", type=int, metavar="N", help="stop after N lines"),
    option(
        "--since",
        type=int,
        metavar="NUMBER",
        help="print also the changes of alerts behind this number, 0: all that the gateway has stored (default: from now on)",
    ),
    option(
        "--resume", type=Path, metavar="FILE", help="keep the number of the last alert in FILE, and continue from it"
    ),
    *ADDRESS_OPTIONS,
)
def run_watch(arguments: argparse.Namespace) -> int:
    """Print messages until Ctrl-C, or as many as are wanted."""
    from gateway.bus.alert_receiver import AlertReceiver
    from gateway.bus.authenticity import Authenticity
    from gateway.bus.client import open_client_session, query_status
    from gateway.daemon.runtime.worker import BoundedQueue
    from gateway.errors import InputError
    from gateway.topics import TOPICS

    topics = {topic.strip() for topic in arguments.topics.split(",")}
    if unknown := sorted(topics - set(TOPICS)):
        raise InputError(f"no topic {', '.join(unknown)}; the topics are {', '.join(TOPICS)}")
    connect, credentials = connect_endpoint(arguments), client_credentials(arguments)
    samples: BoundedQueue[Arrival] = BoundedQueue(MAX_WAITING_MESSAGES)
    printer = _Printer(arguments.count)
    authenticity = Authenticity(credentials.signers)
    with open_client_session(connect, credentials) as session:
        # By the answers messages are known to be fresh, from the first one on.
        query_status(session, arguments.gateway, authenticity, MAX_GREETING_S)
        subscribers = [
            session.declare_subscriber(
                f"{arguments.gateway}/{topic}", lambda each: samples.put((each, time.monotonic()))
            )
            for topic in topics - {ALERT}
        ]
        messages = partial(_messages, samples, session, authenticity)
        if ALERT in topics:
            resume, since = arguments.resume, arguments.since
            with AlertReceiver(
                connect,
                arguments.gateway,
                since=since,
                state_file=resume,
                credentials=credentials,
            ) as receiver:
                printer.print_all(_alerts_and_messages(receiver, samples, messages))
        else:
            printer.print_all(messages(1.0))
        for subscriber in subscribers:
            subscriber.undeclare()
    return 0


class _Printer:
    """Prints lines up to a number, or for ever."""

    def __init__(self, count: int | None) -> None:
        self._left = count

    def print_all(self, lines: Iterator[Line]) -> None:
        """Print lines as JSON, with every control character escaped; None: nothing has come."""
        for line in lines:
            if line is not None:
                print(json.dumps(line), flush=True)
                self._left = None if self._left is None else self._left - 1
            if self._left is not None and self._left <= 0:
                return


def _alerts_and_messages(
    receiver: "AlertReceiver", samples: "BoundedQueue[Arrival]", messages: "Callable[[float], Iterator[Line]]"
) -> Iterator[Line]:
    while True:
        for event in receiver.poll(MAX_OUTPUT_WAIT_S):
            yield _event_line(event)
        while len(samples):
            yield next(messages(0.0))
        yield None


def _messages(
    samples: "BoundedQueue[Arrival]", session: "zenoh.Session", authenticity: "Authenticity", timeout_s: float
) -> Iterator[Line]:
    """Yield the messages that can be read; one that is damaged or of another type is reported and left out."""
    from gateway.bus.authenticity import UNSIGNED
    from gateway.bus.untrusted import gateway_of, parse_message, read_attachment
    from gateway.topics import TOPICS

    while True:
        authenticity.ask(session)
        arrival = samples.get(timeout_s)
        if arrival is None:
            yield None
            continue
        sample, at_s = arrival
        key, content = str(sample.key_expr), sample.payload.to_bytes()
        topic = key.rpartition("/")[2]
        message = None if gateway_of(sample, topic) is None else parse_message(topic, content)
        if message is None:
            why = f"{key}: a message of {len(content)} bytes is left out: it is no {topic} message of a gateway"
            print(printable(why), file=sys.stderr)
            yield None
        else:
            name, attachment = key.removesuffix(f"/{topic}"), read_attachment(sample)
            judge = authenticity.judge_message if TOPICS[topic].signed else lambda *_: UNSIGNED
            doubt = judge(name, topic, content, attachment, at_s)
            yield _marked({"key": key, "message": message}, doubt)


def _event_line(event: "AlertEvent") -> dict[str, Any]:
    from gateway.topics import encode

    if event.change is not None:
        return _marked({"key": f"{event.gateway}/{ALERT}", "message": json.loads(encode(event.change))}, event.doubt)
    if event.missed is not None:
        missed = {"first": event.missed.first, "last": event.missed.last}
        return _marked({"gateway": event.gateway, "missed": missed}, event.doubt)
    standing = None if event.standing is None else json.loads(encode(event.standing))
    return _marked({"gateway": event.gateway, "state": event.state, "standing": standing}, event.doubt)


def _marked(line: dict[str, Any], doubt: "Doubt | None") -> dict[str, Any]:
    """Return a line, with the reason where it is not authenticated."""
    return line if doubt is None else {**line, "not_authenticated": doubt.text}
