"""Counters that the processor writes and the health message reads."""

from dataclasses import dataclass, field

from devices.block import SampleBlock
from gateway.daemon.radio_monitor import RadioMonitor


@dataclass(slots=True)
class SampleCounters:
    """What has passed the processor since start."""

    samples: int = 0
    newest_ns: int | None = None
    """Gateway time of the newest sample."""
    lost: int = 0
    invalid: int = 0
    radio: RadioMonitor = field(default_factory=RadioMonitor)

    def add(self, block: SampleBlock) -> None:
        """Count a block."""
        self.samples += len(block)
        self.newest_ns = int(block.time_ns[-1])
        self.lost += block.lost
        self.invalid += block.invalid
        if block.radio is not None:
            self.radio.add(block.radio)
