"""The sampling thread: reads the device and opens a lost device again. It never waits for another thread."""

import logging
import threading
import time
from dataclasses import replace

from devices.block import DeviceInfo, SampleBlock
from devices.device import Device, EndOfRecording
from devices.errors import DeviceError
from gateway.daemon.runtime.worker import Backoff, BoundedQueue, FaultRegister

log = logging.getLogger("plumbline.device")
PART = "device"
MIN_REOPENING_PAUSE_S = 0.1
"""Pause before the first attempt to open a device again. Basis: a choice; a disturbed bus is well at once, and a missing one
costs no core."""
MAX_REOPENING_PAUSE_S = 0.5
"""Longest pause between two attempts. Basis: a device that returns delivers samples within a second."""


SamplerItem = SampleBlock | DeviceInfo
"""A block, or the description of the device where it was opened again; it may be another part."""


class Sampler(threading.Thread):
    """Owns the device from start to stop. `ended` is set at the end of a recording that is replayed."""

    def __init__(
        self, device: Device, info: DeviceInfo | None, blocks: BoundedQueue[SamplerItem], faults: FaultRegister
    ) -> None:
        """`info`: of the opened device; None: it could not be opened yet."""
        super().__init__(name="sampler", daemon=True)
        self._device = device
        self._info = info
        self.blocks = blocks
        self._faults = faults
        self._stopping = threading.Event()
        self.ended = threading.Event()
        self.recovering = info is None
        """The device is lost."""
        self.reopened = 0
        self.lost_in_queue = 0
        """Number of samples that found the queue full."""
        self.progress_s = time.monotonic()
        """When the thread last began to read or to open the device."""
        self._newest_ns: int | None = None
        self._after_outage = False

    def stop(self) -> None:
        """Ask the thread to end after the present read."""
        self._stopping.set()

    def run(self) -> None:
        """Read until told to stop."""
        try:
            if self._info is None:
                self._recover()
            while not self._stopping.is_set():
                self.progress_s = time.monotonic()
                self._read_once()
        except EndOfRecording:
            self.ended.set()
        finally:
            self._device.close()

    def _read_once(self) -> None:
        try:
            block = self._device.read()
        except DeviceError as error:
            self._faults.set(PART, str(error))
            self._recover()
            return
        if block is not None and len(block):
            self._forward(self._count_outage(block))

    def _count_outage(self, block: SampleBlock) -> SampleBlock:
        """Return a block with the samples that the sensor would have made while the device was away counted as lost before it."""
        first_ns, newest_ns = int(block.time_ns[0]), self._newest_ns
        self._newest_ns = int(block.time_ns[-1])
        if not self._after_outage or newest_ns is None or self._info is None:
            return block
        self._after_outage = False
        missing = round((first_ns - newest_ns) * self._info.odr_hz / 1e9) - 1
        return replace(block, lost=max(block.lost, missing))

    def _forward(self, block: SampleBlock) -> None:
        if self._info is not None and self._info.can_wait:
            while not self._stopping.is_set() and not self.blocks.put_waiting(block, timeout_s=0.5):
                self.progress_s = time.monotonic()
        elif not self.blocks.put(block):
            self.lost_in_queue += len(block)

    def _recover(self) -> None:
        """Try to open the device, with growing pauses, until it answers or the daemon stops."""
        self.recovering = True
        backoff = Backoff(MIN_REOPENING_PAUSE_S, MAX_REOPENING_PAUSE_S)
        while not self._stopping.wait(backoff.pause_s):
            self.progress_s = time.monotonic()
            self._device.close()
            try:
                self._info = self._device.open()
            except DeviceError as error:
                backoff.increase()
                self._faults.set(PART, f"{error}; trying again until it answers")
                continue
            log.info("the device is open: %s", self._info.device_id)
            self.reopened += 1
            self.recovering = False
            self._after_outage = True
            self._faults.clear(PART)
            self.blocks.put(self._info)
            return
