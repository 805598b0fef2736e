"""`plumbline run` with an ADXL355 on a wire that fails at random: the model of the chip stands at the place of `smbus2.SMBus`.

    python -m tests.benchmarks.faulty_wire SEED PERIOD_S run --config gateway.toml

A fault of the wire comes every PERIOD_S on average. Each is a line on standard error.
"""

import errno
import math
import random
import sys
import threading
import time
from collections import deque

import smbus2

from tests.devices.i2c.adxl355_chip import Adxl355Chip
from tests.devices.i2c.i2c_chip import START_NS, FakeClock

PERIOD_S = 6.95
"""Of a swing with a rope of 12 m."""
AMPLITUDE_RAD = math.radians(8.0)
BREATH_S = 180.0
"""Time in which the amplitude goes from zero to its largest value and back, so that alerts come and go."""
RHO = 0.75
NOISE_G = 0.0004
FIRST_S = 10.0
"""The gateway starts on a wire that works."""


class RunningClock(FakeClock):
    """The clock of the chip where real time passes."""

    def __init__(self) -> None:
        super().__init__()
        self._begun_ns = time.monotonic_ns()

    def now_ns(self) -> int:
        return START_NS + time.monotonic_ns() - self._begun_ns

    @property
    def elapsed_s(self) -> float:
        return (time.monotonic_ns() - self._begun_ns) / 1e9

    def pass_s(self, seconds: float) -> None:
        time.sleep(seconds)


def swinging(time_s: float) -> tuple[float, float, float]:
    """Specific force, g, on the rope of a load whose swing grows and decays."""
    amplitude_rad = AMPLITUDE_RAD * 0.5 * (1 - math.cos(2 * math.pi * time_s / BREATH_S))
    phase = 2 * math.pi * time_s / PERIOD_S
    angle_rad = amplitude_rad * math.sin(phase)
    rate2 = (amplitude_rad * math.cos(phase)) ** 2
    noise = (random.gauss(0.0, NOISE_G) for _ in range(3))
    exact = (1 - RHO) * math.sin(angle_rad), 0.0, math.cos(angle_rad) + RHO * rate2
    x, y, z = (value + error for value, error in zip(exact, noise, strict=True))
    return x, y, z


class FaultyWire:
    """Does something to the chip from time to time."""

    def __init__(self, chip: Adxl355Chip, seed: int, period_s: float) -> None:
        self._chip = chip
        self._random = random.Random(seed)
        self._period_s = period_s

    def run(self) -> None:
        kinds = (self.absent, self.clock_held, self.brown_out, self.transfers_fail, self.bursts_high, self.entries_gone)
        time.sleep(FIRST_S)
        while True:
            time.sleep(self._random.expovariate(1 / self._period_s))
            kind = self._random.choice(kinds)
            print(f"WIRE {kind.__name__}", file=sys.stderr, flush=True)
            kind()

    def absent(self) -> None:
        self._chip.absent_until_s = self._chip.clock.elapsed_s + self._random.uniform(0.2, 8)

    def clock_held(self) -> None:
        self._chip.sda_low = True
        time.sleep(self._random.uniform(1, 5))
        self._chip.clear_bus()

    def brown_out(self) -> None:
        self._chip.brown_out()

    def transfers_fail(self) -> None:
        number = self._random.choice((errno.EREMOTEIO, errno.ETIMEDOUT, errno.EIO, errno.EAGAIN))
        self._chip.fail(number, self._random.randrange(1, 20))

    def bursts_high(self) -> None:
        self._chip.high_bursts = self._random.randrange(1, 4)

    def entries_gone(self) -> None:
        self._chip.drop_places(self._random.randrange(1, 6))


def main() -> int:
    """Run the gateway."""
    seed, period_s, *arguments = sys.argv[1:]
    chip = Adxl355Chip(RunningClock(), swinging)
    chip.log = deque(maxlen=8)  # type: ignore[assignment]
    chip.made_ns = deque(maxlen=8)  # type: ignore[assignment]

    def open_bus(_number: int) -> Adxl355Chip:
        chip.closed = False
        return chip

    smbus2.SMBus = open_bus  # type: ignore[misc, assignment]
    threading.Thread(target=FaultyWire(chip, int(seed), float(period_s)).run, daemon=True).start()
    from gateway.cli.main import main as plumbline  # noqa: PLC0415  (after the bus was replaced)

    return plumbline(arguments)


if __name__ == "__main__":
    sys.exit(main())
