"""The sampling thread: reads the device and opens a lost device again. It never waits for another thread."""

import logging
import threading
from dataclasses import dataclass

from devices.block import DeviceInfo, SampleBlock
from devices.device import Device, EndOfRecording
from devices.errors import DeviceError
from gateway.daemon.backoff import Backoff
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.notify import ServiceNotifier

log = logging.getLogger("plumbline.device")
FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 0.5
"""So short that a device that returns delivers samples within a second."""


@dataclass(frozen=True, slots=True)
class DeviceReopened:
    """The device was opened again; it may be another part."""

    info: DeviceInfo


SamplerItem = SampleBlock | DeviceReopened


class Sampler(threading.Thread):
    """Owns the device from start to stop. `ended` is set at the end of a recording that is replayed."""

    def __init__(
        self, device: Device, info: DeviceInfo, blocks: BoundedQueue[SamplerItem], notifier: ServiceNotifier
    ) -> None:
        super().__init__(name="sampler", daemon=True)
        self._device = device
        self._info = info
        self.blocks = blocks
        self._notifier = notifier
        self._stopping = threading.Event()
        self.ended = threading.Event()
        self.recovering = False
        """The device is lost."""
        self.reopened = 0
        self.lost_in_queue = 0
        """Number of samples that found the queue full."""

    def stop(self) -> None:
        """Ask the thread to end after the present read."""
        self._stopping.set()

    def run(self) -> None:
        """Read until told to stop."""
        try:
            while not self._stopping.is_set():
                self._notifier.send("WATCHDOG=1")
                self._read_once()
        except EndOfRecording:
            self.ended.set()
        finally:
            self._device.close()

    def _read_once(self) -> None:
        try:
            block = self._device.read()
        except DeviceError as error:
            log.error("%s", error)
            self._recover()
            return
        if block is not None and len(block):
            self._forward(block)

    def _forward(self, block: SampleBlock) -> None:
        if self._info.can_wait:
            while not self._stopping.is_set() and not self.blocks.put_waiting(block, timeout_s=0.5):
                self._notifier.send("WATCHDOG=1")
        elif not self.blocks.put(block):
            self.lost_in_queue += len(block)

    def _recover(self) -> None:
        """Try to open the device, with growing pauses, until it answers or the daemon stops."""
        self.recovering = True
        backoff = Backoff(FIRST_PAUSE_S, LONGEST_PAUSE_S)
        reported = ""
        while not self._stopping.wait(backoff.pause_s):
            self._notifier.send("WATCHDOG=1")
            self._device.close()
            try:
                self._info = self._device.open()
            except DeviceError as error:
                backoff.increase()
                if str(error) != reported:  # not every half a second
                    reported = str(error)
                    log.warning("%s; trying again until it answers", error)
                continue
            log.info("the device is open again: %s", self._info.device_id)
            self.reopened += 1
            self.recovering = False
            self.blocks.put(DeviceReopened(self._info))
            return
