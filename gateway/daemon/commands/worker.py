"""The thread of the commands: recalibration and configuration are decided and carried out here, and it waits for the disk.

It learns from the processing thread what the sensor reads, and that thread takes the calibration from `RecalibrationService`.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from devices.block import DeviceInfo
from gateway.atomic_io import write_durably
from gateway.daemon.commands.recalibration_service import ProcessedBlock, RecalibrationService
from gateway.daemon.commands.requests import HANGS, RequestHandler, RequestQueue
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.file_input import reason_of
from gateway.recalibration.requests import VERBS

if TYPE_CHECKING:
    from gateway.daemon.commands.site_certificates import SiteCertificates  # its library is an extra

INBOX = 256
"""Blocks and requests that may wait. Basis: a choice; 25 s of blocks of 0.1 s, longer than a write waits for a card."""
RESERVED = 16
"""Places of the inbox that blocks cannot take: for devices and state files. Basis: a choice; requests and state files come one by
one, and blocks lose little."""
WAITING = 16
"""Requests that may wait. Basis: a choice; commands come from persons, and more are refused at once."""
PATIENCE_S = 8.0
"""A step that takes longer hangs: requests are then refused. Basis: an SD card that cleans up stops for several seconds; a client
asks for 30 s."""
PART = "state_files"


@dataclass(frozen=True, slots=True)
class StateFile:
    """A file that is to be replaced."""

    path: Path
    content: bytes


CommandItem = DeviceInfo | ProcessedBlock | StateFile


class CommandWorker(Worker[CommandItem]):
    """Carries out one request after the other, writes state files, and looks at the gateway's certificate."""

    def __init__(
        self,
        recalibration: RecalibrationService,
        handlers: Mapping[str, RequestHandler],
        certificates: "SiteCertificates | None",
        faults: FaultRegister,
    ) -> None:
        """`handlers` carry out the requests of other verbs than those of the recalibration; they may wait for the disk."""
        super().__init__("commands", BoundedQueue(INBOX))
        self._recalibration = recalibration
        self._handlers = dict(handlers) | dict.fromkeys(VERBS, recalibration.carry_out)
        self._certificates = certificates
        self._faults = faults
        self.requests = RequestQueue(WAITING)
        self.judge_trial: Callable[[float], None] | None = None
        """Ends a trial of the configuration when it is due, while samples are taken; its argument is the monotonic time, s."""

    @property
    def verbs(self) -> tuple[str, ...]:
        """The verbs of the requests that are carried out."""
        return tuple(self._handlers)

    def open(self, info: DeviceInfo) -> None:
        """Take a device that was opened. Called by the processing thread."""
        self.inbox.put(info)

    def feed(self, block: ProcessedBlock, patience_s: float) -> None:
        """Take what the pipeline has made of a block; waits so long for room. Called by the processing thread."""
        if not patience_s or not self.inbox.put_waiting(block, patience_s):
            self.inbox.put(block, RESERVED)

    def write_soon(self, path: Path, content: bytes) -> None:
        """Replace a file without waiting for it; the old one stays where that fails, which is reported as a fault."""
        if not self.inbox.put(StateFile(path, content)):
            self._report(path, HANGS)

    def refuse_overdue(self) -> None:
        """Refuse what waits, where this thread does not get on. Called by the main thread."""
        if time.monotonic() - self.progress_s > PATIENCE_S:
            self.requests.refuse(f"could not be executed: {HANGS}")

    def handle(self, item: CommandItem) -> None:
        """Take an item, then do the next step."""
        match item:
            case DeviceInfo():
                self._recalibration.open(item)
            case ProcessedBlock():
                self._recalibration.feed(item)
            case StateFile():
                self._write(item)
        self.idle()

    def idle(self) -> None:
        """Carry out one request, so that many of them do not fill the inbox, and do what is due."""
        self._recalibration.tick()
        if self._certificates is not None:
            self._certificates.watch_expiry()
        if (judge_trial := self.judge_trial) is not None:
            judge_trial(time.monotonic())
        if (request := self.requests.take()) is not None:
            self._handlers[request.verb](request)

    def close(self) -> None:
        """Nothing is open between two steps."""

    def _write(self, file: StateFile) -> None:
        try:
            write_durably(file.path, file.content)
        except OSError as error:
            self._report(file.path, reason_of(error))
        else:
            self._faults.clear(PART)

    def _report(self, path: Path, why: str) -> None:
        self._faults.set(PART, f"{path}: cannot be saved ({why})")
