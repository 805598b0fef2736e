"""The sampling thread: reads the device, hands blocks on, and brings a lost device back. Nothing here waits for anyone else."""

import logging
import threading
from dataclasses import dataclass

from devices.block import DeviceInfo, SampleBlock
from devices.device import Device, EndOfRecording
from devices.errors import DeviceError
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.notify import ServiceNotifier

log = logging.getLogger("plumbline.device")
FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 5.0


@dataclass(frozen=True, slots=True)
class DeviceReopened:
    """The device came back, perhaps as another part."""

    info: DeviceInfo


SamplerItem = SampleBlock | DeviceReopened


class Sampler(threading.Thread):
    """Owns the device from start to stop; `ended` is set when a recording has been read to its end."""

    def __init__(
        self, device: Device, info: DeviceInfo, blocks: BoundedQueue[SamplerItem], notifier: ServiceNotifier
    ) -> None:
        super().__init__(name="sampler", daemon=True)
        self._device = device
        self._info = info
        self._blocks = blocks
        self._notifier = notifier
        self._stopping = threading.Event()
        self.ended = threading.Event()
        self.recovering = False
        self.reopened = 0
        self.lost_in_queue = 0

    def stop(self) -> None:
        """Ask the thread to end after the read under way."""
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
            self._hand_on(block)

    def _hand_on(self, block: SampleBlock) -> None:
        if self._info.can_wait:
            while not self._stopping.is_set() and not self._blocks.put_waiting(block, timeout_s=0.5):
                self._notifier.send("WATCHDOG=1")
        elif not self._blocks.put(block):
            self.lost_in_queue += len(block)

    def _recover(self) -> None:
        """Open the device again, with growing pauses, until it answers or the daemon stops."""
        self.recovering = True
        pause_s = FIRST_PAUSE_S
        while not self._stopping.wait(pause_s):
            self._notifier.send("WATCHDOG=1")
            self._device.close()
            try:
                self._info = self._device.open()
            except DeviceError as error:
                log.warning("%s; next try in %.1f s", error, pause_s)
                pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
                continue
            log.info("device is back: %s", self._info.device_id)
            self.reopened += 1
            self.recovering = False
            self._blocks.put(DeviceReopened(self._info))
            return
