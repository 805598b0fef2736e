"""Recovery of a device in steps: initialise it again, clear its bus, cycle its power.

A transfer that fails is repeated before that (`devices.i2c.bus`); the caller pauses between the attempts.
"""

from collections import Counter
from collections.abc import Callable, Mapping

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import Device
from devices.errors import DeviceError

Hook = Callable[[], bool]
"""Do something to the bus or the supply; return whether it was done."""

CLEAR_AFTER, POWER_AFTER = 2, 4
"""After this many failed openings the bus is cleared, and the power cycled; then both alternate. Basis: a choice; gentle means
first, and some seconds until the strongest."""
POWER_UP_S = 0.1
"""Pause after the power was switched on again. Basis: a choice; chips start in some ms, and longer waits lose samples."""


class RecoveringDevice:
    """A device that is opened with a further step of recovery after every few failures; a step without a hook is left out."""

    def __init__(
        self, device: Device, clock: Clock, *, bus_clear: Hook | None = None, power_cycle: Hook | None = None
    ) -> None:
        """`bus_clear`: nine clock pulses and a stop; `power_cycle`: turn the supply of the sensor off and on."""
        self._device = device
        self._clock = clock
        self._bus_clear = bus_clear
        self._power_cycle = power_cycle
        self._opened = False
        self._failures = 0
        self._faults: Counter[str] = Counter()

    def open(self) -> DeviceInfo:
        """Take the step of recovery that is due, then open the device. Raises `DeviceError`."""
        if self._failures >= POWER_AFTER and self._failures % 2 == 0:
            self._take_step("power_cycled", self._power_cycle)
            self._clock.sleep_s(POWER_UP_S if self._power_cycle else 0.0)
        elif self._failures >= CLEAR_AFTER:
            self._take_step("bus_cleared", self._bus_clear)
        self._faults["reinitialised"] += self._opened
        try:
            info = self._device.open()
        except DeviceError:
            self._failures += 1
            raise
        self._failures = 0
        self._opened = True
        return info

    def read(self) -> SampleBlock | None:
        """Return the next block of the device. Raises `DeviceError`."""
        return self._device.read()

    def close(self) -> None:
        """Close the device."""
        self._device.close()

    @property
    def faults(self) -> Mapping[str, int]:
        """The faults of the device, and the steps: `reinitialised`, `bus_cleared`, `power_cycled`, `recovery_hook_failed`."""
        return {**self._device.faults, **self._faults}

    def _take_step(self, name: str, hook: Hook | None) -> None:
        if hook is not None:
            self._faults[name if hook() else "recovery_hook_failed"] += 1
