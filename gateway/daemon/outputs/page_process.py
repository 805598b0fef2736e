"""The process of the operator's page: started on a socket that the gateway keeps, and started again when it ends."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace

from gateway.configuration.model import Configuration
from gateway.configuration.section import written
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.daemon.runtime.worker import RETRYING, Backoff, FaultRegister
from gateway.errors import PlumblineError
from gateway.extras import what_is_missing
from gateway.page.channel import PARAMETERS, CraneDirections, Frame, Parameters, encode_parameters, listen_at
from gateway.page.sign_in import PIN_NAME, make_pin

MIN_PAGE_START_PAUSE_S = 1.0
"""Pause before the page is started again. Basis: a choice; a browser is without the page for a moment, and a fault at its start
costs no core."""
MAX_PAGE_START_PAUSE_S = 60.0
"""Longest of these pauses. Basis: a choice; who mends the cause waits no longer than a minute."""
BIND_PAUSE_S = 2.0
"""Pause between two attempts to take the address. Basis: a choice; a page that ends frees its address within seconds."""
MAX_START_S = 2.0
"""Longest wait for the start. Basis: a choice; an interpreter starts in less on a small board that is idle."""
PART = "page"
PIN = "page_pin"


class PageError(PlumblineError):
    """The page cannot be served at present; the text names the address and the remedy in one line."""


class PageProcess:
    """Takes the page's address as soon as it is free, and keeps a process on it."""

    def __init__(self, configuration: Configuration, channel: PageChannel, faults: FaultRegister) -> None:
        self._parameters = page_parameters(configuration)
        self._channel = channel
        self._address = configuration.page.address
        self._faults = faults
        self._socket: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._backoff = Backoff(MIN_PAGE_START_PAUSE_S, MAX_PAGE_START_PAUSE_S)
        self._next_start_s = 0.0

    def supervise(self) -> None:
        """Start the process, or start it again after a pause if it has ended; call a few times a second."""
        now_s = time.monotonic()
        if now_s < self._next_start_s:
            return
        if self._process is not None and self._process.poll() is None:
            self._faults.clear(PART)
            return
        if self._process is not None:
            code, self._process = stop_process(self._process), None
            self._faults.set(PART, f"page: its process has ended with code {code} and is started again")
            self._backoff.increase()
        try:
            self._process = self._start()
        except PageError as error:
            self._next_start_s = now_s + BIND_PAUSE_S
            self._faults.set(PART, f"{error}; {RETRYING}")
        else:
            self._next_start_s = now_s + self._backoff.pause_s

    def _start(self) -> subprocess.Popen[bytes]:
        """Take the address where that is not done, and start the process. Raises `PageError`."""
        if self._socket is None:
            if (missing := what_is_missing("page")) is not None:
                raise PageError(f"page: {missing}, or set page.enabled = false")
            self._socket = _bind(*self._address)
        threading.Thread(target=self._make_pin, name="page-pin", daemon=True).start()  # the disk may not answer
        try:
            return start_process(self._parameters, self._socket, self._channel.open)
        except OSError as error:
            raise PageError(f"page: its process cannot be started ({error.strerror})") from error

    def _make_pin(self) -> None:
        """Make the PIN where there is none. Without it the page shows everything, and nobody acknowledges on it."""
        if self._parameters.pin_file is None:
            return
        try:
            make_pin(self._parameters.pin_file)
        except OSError as error:
            self._faults.set(PIN, f"{self._parameters.pin_file}: {error.strerror}; nobody can acknowledge on the page")
        else:
            self._faults.clear(PIN)

    def stop(self) -> None:
        """End the process and release the address."""
        if self._process is not None:
            stop_process(self._process)
        self._channel.close()
        if self._socket is not None:
            self._socket.close()


def start_process(
    parameters: Parameters, listener: socket.socket, open_channel: Callable[[Frame], socket.socket]
) -> subprocess.Popen[bytes]:
    """Start the page on a bound socket, which the caller keeps for a later restart.

    `open_channel` takes the first frame and returns the page's end of the channel. The page has its own process group and does
    not receive the terminal's Ctrl-C: the parent decides when it ends.
    """
    line = encode_parameters(replace(parameters, fd=listener.fileno()))
    with open_channel(Frame(PARAMETERS, time.monotonic(), line)) as channel:
        return subprocess.Popen(
            [sys.executable, "-m", "gateway.page"],
            stdin=channel.fileno(),
            pass_fds=[listener.fileno()],
            process_group=0,
        )


def stop_process(process: subprocess.Popen[bytes]) -> int:
    """End the page, or clean up after one that has ended, and return its exit code. It is killed if it does not end in time."""
    process.terminate()
    try:
        return process.wait(MAX_START_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def page_parameters(configuration: Configuration) -> Parameters:
    """Return the start parameters of the page of this gateway."""
    gateway, alerts = configuration.gateway, configuration.alerts
    return Parameters(
        key=gateway.key,
        warn_deg=alerts.warn_deg,
        trip_deg=alerts.trip_deg,
        clear_deg=alerts.clear_deg,
        lean_trip_deg=alerts.lean_trip_deg,
        stale_s=alerts.stale_s,
        pin_file=gateway.data_dir / PIN_NAME,
        hosts=[configuration.page.address[0], *configuration.page.hosts],
        names=configuration.page.names,
        language=configuration.page.language,
        directions=CraneDirections(**configuration.page.directions.model_dump()),
        title=f"{gateway.site} / {gateway.crane} / {gateway.sensor}",
    )


def _bind(host: str, port: int) -> socket.socket:
    try:
        return listen_at(host, port, 64)
    except OSError as error:
        raise PageError(
            f"page: {written(host, port)} cannot be used ({error.strerror}); end what uses it, or choose another page.listen"
        ) from error
