"""The search for sensors on this machine: known parts on every I2C bus, and serial ports."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from smbus2 import SMBus

from devices.clock import Clock
from devices.errors import DeviceError
from devices.i2c.bus import BusOpener, probe_bus
from devices.i2c.chips import CHIPS

DEV = Path("/dev")
KINDS = {
    **{identity.name: kind for kind, chip in reversed(CHIPS.items()) for identity in chip.identities},
    "ADS1115": "ads1115",
}
"""`device.kind` of each identity on an I2C bus; of two kinds with one identity the first."""
SERIAL_PORTS = ("serial/by-id/*", "ttyUSB*", "ttyACM*", "ttyAMA*")


@dataclass(frozen=True, slots=True)
class FoundSensor:
    """A part or a port that may be the sensor."""

    text: str
    settings: dict[str, str | int]
    """Its keys of `[device]`; without `kind` where the port does not say what is connected."""


@dataclass(frozen=True, slots=True)
class SearchProblem:
    """A bus that could not be searched."""

    text: str


def search_sensors(
    clock: Clock, open_bus: BusOpener = SMBus, dev: Path | None = None
) -> Iterator[FoundSensor | SearchProblem]:
    """Yield known parts on the I2C buses, then the serial ports; problems in between."""
    dev = DEV if dev is None else dev
    for bus in sorted(int(match[1]) for path in dev.glob("i2c-*") if (match := re.fullmatch(r"i2c-(\d+)", path.name))):
        yield from _search_bus(bus, clock, open_bus)
    seen: set[Path] = set()
    for port in (port for pattern in SERIAL_PORTS for port in sorted(dev.glob(pattern))):
        if port.resolve() not in seen:
            seen.add(port.resolve())
            yield FoundSensor(f"what is connected to the serial port {port}", {"port": str(port)})


def _search_bus(bus: int, clock: Clock, open_bus: BusOpener) -> Iterator[FoundSensor | SearchProblem]:
    try:
        for part in probe_bus(bus, clock, open_bus):
            if part.identity is not None and part.identity.name in KINDS:
                settings: dict[str, str | int] = {
                    "kind": KINDS[part.identity.name],
                    "bus": bus,
                    "address": part.address,
                }
                yield FoundSensor(f"{part.identity.name} at {part.address:#04x} on I2C bus {bus}", settings)
            else:
                yield SearchProblem(f"I2C bus {bus}: {part.error or f'an unknown part answers at {part.address:#04x}'}")
    except DeviceError as error:
        yield SearchProblem(str(error))
