"""The thread that has the newest statement about the recordings stamped by an authority outside, where one is configured."""

import logging
import threading
import time
from collections.abc import Callable
from io import BufferedIOBase
from pathlib import Path

from gateway.atomic_io import append_line
from gateway.daemon.runtime.worker import RETRYING, FaultRegister
from gateway.daemon.storage.recording_worker import TIME_STAMPS
from gateway.messages import NewestStatement
from gateway.recording.chain.time_stamps import MAX_RESPONSE_BYTES, NAME, TimeStampError, make_request, take_response

log = logging.getLogger("plumbline.recorder")
LOOK_S = 1.0
"""Time between two looks for a new statement. Basis: a choice; segments last for minutes."""
RETRY_S = 60.0
"""Pause after a failure. Basis: a choice; an authority is not flooded, and a short fault of the network costs a minute."""
TIMEOUT_S, LONGEST_S = 10.0, 30.0
"""Longest silence of the authority, and longest answer. Basis: choices; it answers in less than a second."""
MAX_FILE_BYTES = 8_000_000
"""Size at which the file becomes the previous file; there is one previous file. Basis: a choice; two months at one time stamp an
hour, and half of what is read of a state file."""


class TimeStamper(threading.Thread):
    """Asks for a time stamp on each statement that is new, but not more often than configured. It never delays anything."""

    def __init__(
        self,
        url: str,
        every_s: float,
        newest: Callable[[], NewestStatement | None],
        data_dir: Path,
        faults: FaultRegister,
    ) -> None:
        """`every_s` is the least time between two; `newest` returns the newest statement, None: there is none yet."""
        super().__init__(name="time-stamps", daemon=True)
        self._url = url
        self._every_s = every_s
        self._newest = newest
        self._path = data_dir / NAME
        self._faults = faults
        self._stopping = threading.Event()

    def stop(self) -> None:
        """Ask the thread to end; nobody needs to wait for it."""
        self._stopping.set()

    def run(self) -> None:
        """Stamp until told to stop."""
        due_s, stamped = 0.0, None
        while not self._stopping.wait(LOOK_S):
            newest = self._newest()
            if newest is None or newest == stamped or time.monotonic() < due_s:
                continue
            try:
                self._stamp(newest)
            except (TimeStampError, OSError, ValueError) as error:
                self._faults.set(TIME_STAMPS, f"{self._url}: no time stamp ({error}); {RETRYING}")
                due_s = time.monotonic() + RETRY_S
            else:
                self._faults.clear(TIME_STAMPS)
                stamped, due_s = newest, time.monotonic() + self._every_s

    def _stamp(self, newest: NewestStatement) -> None:
        request = make_request(newest)
        line = take_response(request, newest, _post(self._url, request.as_bytes()))
        append_line(self._path, line, max_bytes=MAX_FILE_BYTES)


def _post(url: str, query: bytes) -> bytes:
    """Return the answer of an authority (RFC 3161, 3.4). Raises `OSError` and `TimeStampError`."""
    from http.client import HTTPException  # noqa: PLC0415  (5 MB that only who wants time stamps pays)
    from urllib.request import Request, urlopen  # noqa: PLC0415

    request, end_s = Request(url, query, {"Content-Type": "application/timestamp-query"}), time.monotonic() + LONGEST_S
    try:
        with urlopen(request, timeout=TIMEOUT_S) as reply:
            return _read(reply, end_s)
    except HTTPException as error:
        raise TimeStampError(str(error)) from error


def _read(reply: BufferedIOBase, end_s: float) -> bytes:
    content = b""
    while part := reply.read1(MAX_RESPONSE_BYTES):
        content += part
        if len(content) > MAX_RESPONSE_BYTES or time.monotonic() > end_s:
            raise TimeStampError("the authority's answer is too long, or takes too long")
    return content
