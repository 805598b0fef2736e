"""`python -m gateway.daemon.outputs.relay_watchdog`: the process of the relay.

It switches the relay, and drops it when the gateway falls silent. It outlives the gateway's death by `kill -9`: the pipe ends,
and the relay is released. It imports nothing of the gateway but the words of the pipe, so that it starts at once and takes little
memory.
"""

import os
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from gateway.daemon.outputs.relay_output import OutputError, RelayOutput, make_output
from gateway.relay.protocol import ENERGISE, RELEASE, RelayParameters, RelayState

RELEASE_RETRY_S = 1.0
"""A release that has failed is tried again after this time. Basis: a choice; a relay that has not fallen is urgent, and one
attempt per second costs nothing."""
MAX_REQUEST_BYTES = 65536
"""Largest line, bytes. Basis: a choice; a line has some hundred bytes, and what has no end is refused."""


class RelayWatchdog:
    """Keeps the output energised while it is asked to in time."""

    def __init__(self, output: RelayOutput, watchdog_s: float, report: Callable[[RelayState, str], None]) -> None:
        self._output = output
        self._watchdog_s = watchdog_s
        self._report = report
        self._deadline_s = 0.0
        """The relay is released from this time on, unless it is asked for again."""
        self._state: RelayState = "released"

    def receive(self, line: bytes, now_s: float) -> None:
        """Take a line of the gateway, and answer with the state."""
        if line == ENERGISE.strip():
            self._deadline_s = now_s + self._watchdog_s
        elif line == RELEASE.strip():
            self._deadline_s = now_s
        self.apply(now_s, answer=True)

    def apply(self, now_s: float, *, answer: bool = False) -> None:
        """Switch the output as the time demands; report a change, and the state where an answer is due."""
        energised = now_s < self._deadline_s
        state: RelayState = "energised" if energised else "released"
        text = ""
        try:
            self._output.apply(energised)
        except OutputError as error:
            state, text = "failed", str(error)
            self._deadline_s = now_s
            with suppress(OutputError):  # an output that cannot be energised is released until it is asked for again
                self._output.apply(False)
        if answer or state != self._state:
            self._report(state, text)
        self._state = state

    def wait_s(self, now_s: float) -> float:
        """Return the longest time until `apply` is due again."""
        waits = [RELEASE_RETRY_S]
        if now_s < self._deadline_s:
            waits.append(self._deadline_s - now_s)
            if self._output.interval_s is not None:
                waits.append(self._output.interval_s)
        return min(waits)


def main() -> int:
    """Serve until the pipe ends or a signal comes, then release the relay. Return 0, or 1 if it could not be switched."""
    stopping: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: stopping.append(1))
    source = sys.stdin.fileno()
    lines = _LineReader(source)
    first: list[bytes] | None = []
    while not first:
        first = lines.read()
        if first is None:
            return 1
    parameters = RelayParameters.decode(first[0])
    try:
        output = make_output(parameters)
    except OutputError as error:
        _report("failed", str(error))
        return 1
    watchdog = RelayWatchdog(output, parameters.watchdog_s, _report)
    watchdog.apply(time.monotonic(), answer=True)
    while not stopping:
        received: list[bytes] | None = []
        if select.select([source], [], [], watchdog.wait_s(time.monotonic()))[0]:
            received = lines.read()
        if received is None:
            break
        if received:
            watchdog.receive(received[-1], time.monotonic())  # the last word counts
        else:  # also after a part of a line, or a gateway that stops within one would postpone the release
            watchdog.apply(time.monotonic())
    return _release(output)


class _LineReader:
    """Whole lines of a pipe."""

    def __init__(self, source: int) -> None:
        self._source = source
        self._rest = b""

    def read(self) -> list[bytes] | None:
        """Return the whole lines after one read, maybe none; None at the end of the pipe."""
        data = os.read(self._source, MAX_REQUEST_BYTES)
        if not data or len(self._rest) > MAX_REQUEST_BYTES:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        return lines


def _release(output: RelayOutput) -> int:
    try:
        output.close()
    except OutputError as error:
        _report("failed", str(error))
        return 1
    _report("released", "")
    return 0


def _report(state: RelayState, text: str) -> None:
    """Write the state; where nobody reads any more, that is no reason to end."""
    try:
        os.write(1, f"{state} {text}".strip().replace("\n", " ").encode() + b"\n")
    except OSError:
        return


if __name__ == "__main__":
    sys.exit(main())
