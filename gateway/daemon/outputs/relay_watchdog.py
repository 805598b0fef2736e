"""`python -m gateway.daemon.outputs.relay_watchdog`: the process of the relay, with its outputs: a command, or a GPIO line.

It switches the relay, and drops it when the gateway falls silent. It outlives the gateway's death by `kill -9`: the pipe ends,
and the relay is released. It imports next to nothing of the gateway, so that it starts at once and takes little memory.

The gateway and it say one line each, over pipes. The gateway sends the settings as JSON, then `ENERGISE` with every alert that is
well, and `RELEASE` otherwise. The process answers each line, and reports each change of its own, with the state of the output.
"""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from json import dumps, loads
from typing import Any, Literal, Protocol

from gateway.extras import what_is_missing

ENERGISE, RELEASE = b"energise\n", b"release\n"
RelayState = Literal["energised", "released", "failed"]
STATES_BY_LINE: dict[bytes, RelayState] = {b"energised": "energised", b"released": "released", b"failed": "failed"}
"""failed: the output could not be switched; what the relay does is not known."""
RELEASE_RETRY_S = 1.0
"""A release that has failed is tried again after this time. Basis: a choice; a relay that has not fallen is urgent, and one
attempt per second costs nothing."""
MAX_REQUEST_BYTES = 65536
"""Largest line, bytes. Basis: a choice; a line has some hundred bytes, and what has no end is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayParameters:
    """The settings of the process that switches the relay: either a command or a GPIO line."""

    watchdog_s: float
    command: list[str] | None = None
    command_timeout_s: float = 1.0
    repeat_s: float = 10.0
    chip: str | None = None
    line: int = 0
    active_low: bool = False
    pulse_hz: float | None = None

    def encode(self) -> bytes:
        """Return the settings as one line."""
        return dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def decode(cls, line: bytes) -> "RelayParameters":
        """Return the settings of a line that `encode` has written."""
        return cls(**loads(line))


class OutputError(Exception):
    """The output could not be switched."""


class RelayOutput(Protocol):
    """Switches the relay."""

    def apply(self, energised: bool) -> None:
        """Switch, or keep the state; called again and again. Raises `OutputError`."""

    @property
    def interval_s(self) -> float | None:
        """Longest time between two calls while energised; None: no limit."""

    def close(self) -> None:
        """Release the relay. Raises `OutputError`."""


class CommandOutput:
    """Runs a command at each change, and again after a while, for relays that lose their state."""

    def __init__(self, parameters: RelayParameters) -> None:
        assert parameters.command is not None
        self._command = parameters.command
        self._timeout_s = parameters.command_timeout_s
        self._repeat_s = parameters.repeat_s
        self._done: bool | None = None
        self._done_s = 0.0

    @property
    def interval_s(self) -> float | None:
        """The interval of the repetition."""
        return self._repeat_s

    def apply(self, energised: bool) -> None:
        """Run the command where something is to change, or the last run is long ago."""
        if self._done is energised and time.monotonic() - self._done_s < self._repeat_s:
            return
        self._done = None
        self._run("energise" if energised else "release")
        self._done, self._done_s = energised, time.monotonic()

    def close(self) -> None:
        """Run the command once more."""
        self._run("release")

    def _run(self, word: str) -> None:
        try:
            done = subprocess.run(
                [*self._command, word],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=self._timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise OutputError(f"{self._command[0]} {word}: not done in {self._timeout_s:g} s") from None
        except OSError as error:
            raise OutputError(f"{self._command[0]} {word}: {error.strerror}") from error
        if done.returncode:
            raise OutputError(f"{self._command[0]} {word}: exit code {done.returncode}")


class GpioOutput:
    """Holds a GPIO line as an output; with a pulse, each call while energised is half a period."""

    def __init__(self, parameters: RelayParameters) -> None:
        """Request the line, inactive. Raises `OutputError`."""
        if (missing := what_is_missing("relay")) is not None:
            raise OutputError(missing)
        import gpiod
        from gpiod.line import Direction, Value

        self._off, self._on = Value.INACTIVE, Value.ACTIVE
        self._line = parameters.line
        self._half_s = None if parameters.pulse_hz is None else 0.5 / parameters.pulse_hz
        self._level: Any = self._off
        self._edge_s = 0.0
        settings = gpiod.LineSettings(
            direction=Direction.OUTPUT, active_low=parameters.active_low, output_value=Value.INACTIVE
        )
        try:
            self._request = gpiod.request_lines(
                str(parameters.chip), consumer="plumbline-relay", config={parameters.line: settings}
            )
        except (OSError, ValueError) as error:
            raise OutputError(f"{parameters.chip}, line {parameters.line}: {error}") from error

    @property
    def interval_s(self) -> float | None:
        """Half a period of the pulse."""
        return self._half_s

    def apply(self, energised: bool) -> None:
        """Set the level of the line; with a pulse, the other one when half a period has passed."""
        now_s = time.monotonic()
        if not energised:
            self._level = self._off
        elif self._half_s is None:
            self._level = self._on
        elif now_s - self._edge_s >= 0.9 * self._half_s:
            self._level, self._edge_s = self._on if self._level is self._off else self._off, now_s
        try:
            self._request.set_value(self._line, self._level)
        except OSError as error:
            raise OutputError(f"line {self._line}: {error}") from error

    def close(self) -> None:
        """Make the line inactive and give it back."""
        self.apply(False)
        self._request.release()


def make_output(parameters: RelayParameters) -> RelayOutput:
    """Return the configured output. Raises `OutputError`."""
    return CommandOutput(parameters) if parameters.command is not None else GpioOutput(parameters)


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
