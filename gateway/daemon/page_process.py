"""The process of the operator's page: started on a socket that is already bound, and started again when it ends."""

import importlib.util
import logging
import socket
import subprocess
import time

from gateway.configuration.model import Configuration
from gateway.daemon.backoff import Backoff
from gateway.daemon.page_channel import PageChannel
from gateway.errors import PlumblineError
from gateway.page import launch
from gateway.page.parameters import CraneDirections, Parameters

log = logging.getLogger("plumbline.page")
PAGE_MODULES = ("starlette", "uvicorn")
FIRST_PAUSE_S = 1.0
LONGEST_PAUSE_S = 60.0


class PageError(PlumblineError):
    """The page cannot be served; the text names the address and the remedy in one line."""


class PageProcess:
    """Binds the page's address at once, so that an occupied one is detected at start, and keeps a process on it."""

    def __init__(self, configuration: Configuration, channel: PageChannel) -> None:
        """Bind the address. Raises `PageError`."""
        missing = [name for name in PAGE_MODULES if importlib.util.find_spec(name) is None]
        if missing:
            raise PageError(
                f"page: {', '.join(missing)} not installed; install plumbline-gateway[page], or set page.enabled = false"
            )
        self._parameters = page_parameters(configuration)
        self._channel = channel
        self._socket = _bind(*configuration.page.address)
        self._process: subprocess.Popen[bytes] | None = None
        self._backoff = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        self._started_s = 0.0

    def supervise(self) -> None:
        """Start the process, or start it again after a pause if it has ended; call a few times a second."""
        now_s = time.monotonic()
        if self._process is not None and self._process.poll() is None:
            return
        if self._process is not None:
            if now_s - self._started_s < self._backoff.pause_s:
                return
            log.error("the page's process has ended with code %s and is started again", launch.stop(self._process))
            self._backoff.increase()
        self._started_s = now_s
        self._process = launch.start(self._parameters, self._socket, self._channel.open)

    def stop(self) -> None:
        """End the process and release the address."""
        if self._process is not None:
            launch.stop(self._process)
        self._channel.close()
        self._socket.close()


def page_parameters(configuration: Configuration) -> Parameters:
    """Return the start parameters of the page of this gateway."""
    gateway, alerts = configuration.gateway, configuration.alerts
    return Parameters(
        key=gateway.key,
        warn_deg=alerts.warn_deg,
        trip_deg=alerts.trip_deg,
        lean_trip_deg=alerts.lean_trip_deg,
        stale_s=alerts.stale_s,
        language=configuration.page.language,
        directions=CraneDirections(**configuration.page.directions.model_dump()),
        title=f"{gateway.site} / {gateway.crane} / {gateway.sensor}",
    )


def _bind(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server((host, port), backlog=64)
    except OSError as error:
        raise PageError(
            f"page: {host}:{port} cannot be used ({error.strerror}); stop the program that uses it, or choose another page.listen"
        ) from error
