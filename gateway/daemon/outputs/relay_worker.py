"""The relay thread: decides on each alert whether the relay is energised, and keeps the process alive that switches it."""

import logging
import math
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from gateway.configuration.relay_section import CommandRelay, GpioRelay, RelaySection
from gateway.daemon.outputs.relay_watchdog import ENERGISE, RELEASE, STATES_BY_LINE, RelayParameters, RelayState
from gateway.daemon.runtime.worker import Backoff, BoundedQueue, FaultRegister, Worker
from gateway.gateway_state import GatewayState, stated_state
from gateway.messages import CALIBRATION_RULE, ActiveAlert, Alert, Level

DROP_LEVELS: dict[str, tuple[Level, ...]] = {"warn": ("warn", "trip"), "trip": ("trip",)}
log = logging.getLogger("plumbline.relay")
PART = "relay"
MAX_WAITING_RELAY_ALERTS = 64
"""Alerts that may wait. Basis: a choice; all rules state their alerts once per second, and only the newest count."""
MIN_RELAY_START_PAUSE_S, MAX_RELAY_START_PAUSE_S = 0.2, 10.0
"""Pauses before the watchdog is started again, the first and the longest. Basis: a choice; the relay has fallen meanwhile, and a
fault at the start costs no core."""
MAX_RELAY_ANSWER_S = 2.0
"""Longest usual time between a line and its answer, beside that of the output. Basis: a choice; an answer takes milliseconds, and
a busy core delays it by less."""
END_S = 1.0
"""Longest time of its end beside two commands. Basis: a choice; the end itself takes milliseconds."""
MAX_ANSWER_BYTES = 65536
"""Bytes that are read at once. Basis: a choice; the size of a pipe."""
SAFE_PATH = ["-P"] if sys.flags.safe_path else []


@dataclass(frozen=True, slots=True)
class RelayDecision:
    """Whether the relay is energised, and why it is not."""

    energised: bool
    reason: str


class RelayLogic:
    """Judges each alert message. Before the first known level the relay is released."""

    def __init__(self, settings: RelaySection) -> None:
        self._settings = settings
        self._known_s = -math.inf
        """Time of the last alert in which everything was known."""

    def judge(self, alert: Alert, time_s: float) -> RelayDecision:
        """Return whether the relay is energised after this message."""
        if not _is_unknown(alert):
            self._known_s = time_s
        dropping = [active for active in alert.active if self._drops(active)]
        if dropping:
            return RelayDecision(False, "; ".join(active.text for active in dropping))
        if alert.level in DROP_LEVELS[self._settings.drop_at] and not alert.active:
            return RelayDecision(False, alert.text)
        if time_s - self._known_s > self._settings.unknown_s or not math.isfinite(self._known_s):
            return RelayDecision(False, f"not known for more than {self._settings.unknown_s:g} s: {alert.text}")
        return RelayDecision(True, "")

    def _drops(self, active: ActiveAlert) -> bool:
        if active.level not in DROP_LEVELS[self._settings.drop_at]:
            return False
        return not (self._settings.ignore_acknowledged and active.acknowledged_by is not None)


def _is_unknown(alert: Alert) -> bool:
    """Return whether the gateway says so of its levels, or one is unknown or stands without a known value."""
    return (
        stated_state(alert) is not GatewayState.FINE
        or alert.level == "unknown"
        or any(
            active.level == "unknown" or (active.rule != CALIBRATION_RULE and active.value_deg is None)
            for active in alert.active
        )
    )


class RelayWorker(Worker[Alert]):
    """Owns the process that switches the relay. No other thread ever waits for it."""

    def __init__(self, settings: CommandRelay | GpioRelay, faults: FaultRegister) -> None:
        super().__init__(PART, BoundedQueue(MAX_WAITING_RELAY_ALERTS))
        self._register = faults
        self._logic = RelayLogic(settings)
        self._parameters = relay_parameters(settings)
        self._patience_s = settings.watchdog_s + MAX_RELAY_ANSWER_S + 2 * self._parameters.command_timeout_s
        self._process: subprocess.Popen[bytes] | None = None
        self._backoff = Backoff(MIN_RELAY_START_PAUSE_S, MAX_RELAY_START_PAUSE_S)
        self._started_s = 0.0
        self._answered_s = 0.0
        self._rest = b""
        self._decision = RelayDecision(False, "no alert was judged yet")
        self.state: RelayState = "released"
        """As the process has last stated it; failed: not known."""
        self._restarts, self._unanswered = 0, 0

    @property
    def faults(self) -> Mapping[str, int]:
        """Faults since start, by name. Called by any thread."""
        return {"relay_restarted": self._restarts, "relay_not_confirmed": self._unanswered}

    @property
    def reason(self) -> str | None:
        """Why the relay is released; None while it is not. Called by any thread."""
        return self._decision.reason or None

    def handle(self, item: Alert) -> None:
        """Judge an alert and pass the decision on."""
        decision = self._logic.judge(item, time.monotonic())
        if decision.energised != self._decision.energised:
            log.warning("relay %s", "energised: all is well" if decision.energised else f"released: {decision.reason}")
        self._decision = decision
        self._supervise()
        self._send(ENERGISE if decision.energised else RELEASE)

    def idle(self) -> None:
        """Read the answers, and start the process again where it has ended or hangs."""
        self._supervise()

    def close(self) -> None:
        """Let the process release the relay and end."""
        if self._process is None:
            return
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(END_S + 2 * self._parameters.command_timeout_s)
        except subprocess.TimeoutExpired:
            log.error("the relay's process does not end; it is killed")
            self._kill()
        self._read_answers(time.monotonic())
        self._close_pipes()

    def _supervise(self) -> None:
        now_s = time.monotonic()
        if self._process is None or self._process.poll() is not None:
            self._start_again(now_s)
            return
        self._read_answers(now_s)
        if now_s - self._answered_s > self._patience_s:
            self._unanswered += 1
            self._register.set(PART, "relay: its process does not answer and is started again")
            self._kill()

    def _start_again(self, now_s: float) -> None:
        """Start the process, or start it again after a pause."""
        if self._process is not None:
            self._read_answers(now_s)
            if now_s - self._started_s < self._backoff.pause_s:
                return
            self._register.set(
                PART, f"relay: its process has ended with code {self._process.returncode} and is started again"
            )
            self._restarts += 1
            self._backoff.increase()
            self._close_pipes()
        self._started_s = self._answered_s = now_s
        self._rest = b""
        self._process = subprocess.Popen(
            [sys.executable, *SAFE_PATH, "-m", "gateway.daemon.outputs.relay_watchdog"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            process_group=0,  # Ctrl-C ends the gateway; the end of the pipe then ends this process
        )
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            os.set_blocking(pipe.fileno(), False)
        self._send(self._parameters.encode())

    def _send(self, line: bytes) -> None:
        """Write a line without waiting; what does not fit is a process that hangs, which the missing answer shows."""
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                os.write(self._process.stdin.fileno(), line)

    def _read_answers(self, now_s: float) -> None:
        assert self._process is not None
        assert self._process.stdout is not None
        try:
            data = os.read(self._process.stdout.fileno(), MAX_ANSWER_BYTES)
        except OSError:  # nothing has come
            return
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            word, _, text = line.partition(b" ")
            self._answered_s = now_s
            self.state = STATES_BY_LINE.get(word, "failed")
            if self.state == "failed":
                self._register.set(PART, f"relay: it cannot be switched: {text.decode(errors='replace')}")
            else:
                self._register.clear(PART)

    def _kill(self) -> None:
        assert self._process is not None
        self._process.kill()
        self._process.wait()

    def _close_pipes(self) -> None:
        assert self._process is not None
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()


def relay_parameters(settings: CommandRelay | GpioRelay) -> RelayParameters:
    """Return the settings of the process."""
    if isinstance(settings, CommandRelay):
        return RelayParameters(
            watchdog_s=settings.watchdog_s,
            command=list(settings.command),
            command_timeout_s=settings.command_timeout_s,
            repeat_s=settings.repeat_s,
        )
    return RelayParameters(
        watchdog_s=settings.watchdog_s,
        chip=str(settings.chip),
        line=settings.line,
        active_low=settings.active_low,
        pulse_hz=settings.pulse_hz,
    )
