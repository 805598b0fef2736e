"""`plumbline` with a sensor on a wire and a disk that are broken while a file says so.

    python -m tests.benchmarks.faulty_site FOLDER run --config gateway.toml

While FOLDER/wire exists the sensor does not answer; while FOLDER/disk exists the calls that sync do not return.
"""

import os
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import smbus2

from tests.benchmarks.faulty_wire import RunningClock, swinging
from tests.devices.i2c.adxl355_chip import Adxl355Chip


class SwitchedChip(Adxl355Chip):
    """Answers while a file does not exist."""

    switch: Path

    @property
    def refusing(self) -> bool:
        return self.switch.exists()


def stalling(call: Callable[[int], None], switch: Path) -> Callable[[int], None]:
    """Return a call that waits while a file exists."""

    def wait(descriptor: int) -> None:
        while switch.exists():
            time.sleep(0.05)
        call(descriptor)

    return wait


def main() -> int:
    """Run the gateway."""
    folder = Path(sys.argv[1])
    chip = SwitchedChip(RunningClock(), swinging)
    chip.switch = folder / "wire"
    chip.log, chip.made_ns = deque(maxlen=8), deque(maxlen=8)  # type: ignore[assignment]

    def open_bus(_number: int) -> SwitchedChip:
        chip.closed = False
        return chip

    smbus2.SMBus = open_bus  # type: ignore[misc, assignment]
    os.fsync, os.fdatasync = (stalling(call, folder / "disk") for call in (os.fsync, os.fdatasync))  # type: ignore[assignment]
    from gateway.cli.main import main as plumbline  # noqa: PLC0415  (after the calls were replaced)

    return plumbline(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
