"""Cost of reading each part: time per sample of the driver, and what the bus allows at the FIFO's size.

The chip is a model at the bus. Its own time is measured apart and taken off.
"""

import time
from dataclasses import dataclass
from typing import Any

from devices.i2c.chips import CHIPS
from tests.devices.i2c.part_rig import PARTS, Part, PartRig

CHIP_S = 20.0
BUS_HZ = (100_000, 400_000, 1_000_000)
FASTEST_HZ = {"adxl355": 4000.0, "adxl357": 4000.0, "adxl345": 800.0, "lis3dh": 400.0, "lis2dw12": 800.0}


@dataclass(frozen=True, slots=True)
class Reading:
    """What was measured of one part."""

    samples: int
    driver_s: float
    model_s: float
    bus_bits: int


def measure(part: Part, odr_hz: float, block_samples: int) -> Reading:
    """Read a part for a while of its own time, in blocks of a length."""
    rig = PartRig(part, odr_hz=odr_hz, bus_hz=1_000_000)
    rig.device._block_samples = block_samples
    spent_s, bits = [0.0], [0]
    transfer, take = rig.chip.i2c_rdwr, rig.chip._take_bytes

    def timed(*messages: Any) -> None:
        begin_s = time.perf_counter()
        transfer(*messages)
        spent_s[0] += time.perf_counter() - begin_s

    def counted(count: int) -> None:
        bits[0] += 9 * count
        take(count)

    rig.chip.i2c_rdwr, rig.chip._take_bytes = timed, counted  # type: ignore[method-assign]
    rig.open()
    spent_s[0], bits[0] = 0.0, 0
    begin_s = time.perf_counter()
    rig.read_s(CHIP_S)
    total_s = time.perf_counter() - begin_s
    return Reading(rig.samples, total_s - spent_s[0], spent_s[0], bits[0])


def main() -> None:
    """Print one line for each part."""
    print(
        "part      rate Hz  block  driver us/sample  model us/sample  samples/s of the driver  of the bus at 100k, 400k, 1M"
    )
    for part in PARTS:
        odr_hz = FASTEST_HZ.get(part.kind, 1000.0)
        longest = CHIPS[part.kind](odr_hz, part.range_g).longest_block
        found = measure(part, odr_hz, longest)
        driver_us, model_us = (1e6 * each / found.samples for each in (found.driver_s, found.model_s))
        limits = ", ".join(f"{bus_hz * found.samples / found.bus_bits:.0f}" for bus_hz in BUS_HZ)
        print(
            f"{part.kind:<9} {odr_hz:7.0f} {longest:6d} {driver_us:17.1f} {model_us:16.1f} {1e6 / driver_us:24.0f}  {limits}"
        )
