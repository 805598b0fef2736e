"""`plumbline setup` with a chip at the place of `smbus2.SMBus`: python -m tests.system.setup_on_chips DEV ARGUMENTS."""

import sys
import time
from pathlib import Path

import smbus2

from tests.devices.i2c.adxl355_chip import Adxl355Chip
from tests.devices.i2c.chip_bus import ChipBus
from tests.devices.i2c.i2c_chip import START_NS, FakeClock


class HostPacedClock(FakeClock):
    """The clock of the chips: real time, which passes by itself."""

    def __init__(self) -> None:
        self._begun_ns = time.monotonic_ns()

    @property
    def time_ns(self) -> int:  # type: ignore[override]
        return START_NS + time.monotonic_ns() - self._begun_ns

    @property
    def elapsed_s(self) -> float:
        return (self.time_ns - START_NS) / 1e9

    def pass_s(self, seconds: float) -> None:
        pass


if __name__ == "__main__":
    bus = ChipBus(HostPacedClock(), Adxl355Chip(HostPacedClock(), lambda _: (0.02, -0.01, 1.0)))
    setattr(smbus2, "SMBus", bus)  # noqa: B010 a name of its type for mypy
    from gateway.cli.main import main
    from gateway.daemon.sampling import device_search

    device_search.DEV = Path(sys.argv[1])
    sys.exit(main(sys.argv[2:]))
