"""The outputs of a relay: a command, or a GPIO line. Only the process of the relay uses them."""

import subprocess
import time
from typing import Any, Protocol

from gateway.extras import what_is_missing
from gateway.relay.protocol import RelayParameters


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
