"""The devices by their configuration, and the rigger of the simulated crane, who does what a recalibration asks for.

A module of `devices` is imported only when its kind is configured.
"""

import logging
import math
import subprocess
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from devices.clock import Clock
from devices.device import Device
from devices.errors import DeviceError
from gateway.configuration.device_plugins import PluginError, load_plugin
from gateway.configuration.device_section import DeviceSection
from gateway.configuration.device_sections import (
    Ads1115Device,
    AsppDevice,
    I2cDevice,
    I2cSection,
    IioDevice,
    NodeDevice,
    ReplayDevice,
    SimulatedDevice,
    SingleAxisDevice,
    WitMotionDevice,
)
from gateway.configuration.model import Configuration
from gateway.messages import CalibrationSession

if TYPE_CHECKING:
    from devices.simulated.device import SimulatedCrane

log = logging.getLogger("plumbline.device")
BLOCK_S = 0.1
"""Length of a block where it is not configured. Basis: the tilt is published at 10 Hz, with each block at most."""
MAX_BLOCK_SAMPLES = 32
"""Largest number of samples of a block. Basis: a choice; as many as the FIFOs of ADXL345 and ADXL355 hold (data sheets)."""
HOOK_S = 5.0
"""Longest time of a recovery command. Basis: half the period of the watchdog of the service (WatchdogSec, 10 s)."""


def block_samples(device: DeviceSection) -> int:
    """Return the samples per block: as configured, or those of a tenth of a second, at most 32."""
    if device.block_samples is not None:
        return device.block_samples
    rate_hz = getattr(device, "odr_hz", None)
    return MAX_BLOCK_SAMPLES if rate_hz is None else max(1, min(MAX_BLOCK_SAMPLES, math.ceil(rate_hz * BLOCK_S)))


def make_device(configuration: Configuration, clock: Clock) -> Device:
    """Return the configured device, not yet opened. Raises `DeviceError` where it cannot be made."""
    device: DeviceSection = configuration.device
    n = block_samples(device)
    try:
        if isinstance(device, SimulatedDevice):
            return _make_simulated(configuration, device, n, clock)
        make = next((make for kind, make in _MAKERS.items() if isinstance(device, kind)), None)
        if make is None:
            return load_plugin(device.kind).make(device, n, clock)
        made = make(device, n, clock)
        return _make_recovering(device, made, clock) if isinstance(device, I2cSection) else made
    except (ValueError, PluginError) as error:
        raise DeviceError(f"device: {error}") from error


def _make_simulated(configuration: Configuration, device: SimulatedDevice, block: int, clock: Clock) -> Device:
    from devices.simulated.device import SimulatedCrane

    position_m = configuration.housing_position_m
    if position_m is None:
        raise ValueError("the position of the simulated housing on the rope is not given")
    return SimulatedCrane(
        odr_hz=device.odr_hz,
        range_g=device.range_g,
        block_samples=block,
        seed=device.seed,
        length_m=configuration.rope.length_m,
        position_m=position_m,
        gravity_m_s2=configuration.site.local_gravity_m_s2,
        clock=clock,
    )


def _make_chip(device: I2cDevice, block: int, clock: Clock) -> Device:
    from devices.i2c.fifo_accelerometer import FifoAccelerometer

    return FifoAccelerometer(
        device.chip(device.odr_hz, device.range_g),
        bus=device.bus,
        address=device.address,
        clock=clock,
        block_samples=block,
        serial=device.serial,
    )


def _make_recovering(section: I2cSection, device: Device, clock: Clock) -> Device:
    from devices.recovery import Hook, RecoveringDevice

    def hook(command: list[str]) -> Hook | None:
        return partial(run_hook, command) if command else None

    bus_clear, power_cycle = hook(section.bus_clear_command), hook(section.power_cycle_command)
    return RecoveringDevice(device, clock, bus_clear=bus_clear, power_cycle=power_cycle)


def _make_ads1115(device: Ads1115Device, block: int, clock: Clock) -> Device:
    from devices.i2c.analogue_accelerometer import ANALOGUE_PARTS, AnalogueAccelerometer

    return AnalogueAccelerometer(
        ANALOGUE_PARTS[device.sensor],
        bus=device.bus,
        address=device.address,
        clock=clock,
        odr_hz=device.odr_hz,
        block_samples=block,
        serial=device.serial,
    )


def _make_combined(device: SingleAxisDevice, block: int, clock: Clock) -> Device:
    from devices.combined_axes import CombinedAxes, SensitiveAxis
    from devices.i2c.chips import CHIPS
    from devices.i2c.fifo_accelerometer import FifoAccelerometer

    axes = []
    for sensor in device.sensors:
        chip = CHIPS[sensor.part](device.odr_hz, sensor.range_g)
        driver = FifoAccelerometer(chip, sensor.bus, sensor.address, clock=clock, block_samples=block)
        axes.append(SensitiveAxis(driver, *sensor.axis))
    return CombinedAxes(axes, odr_hz=device.odr_hz, serial=device.serial)


def _make_iio(device: IioDevice, block: int, clock: Clock) -> Device:
    if device.mode == "polled":
        from devices.iio.polled import PolledIioAccelerometer

        return PolledIioAccelerometer(
            device.name,
            clock=clock,
            odr_hz=device.odr_hz,
            range_g=device.range_g,
            block_samples=block,
            serial=device.serial,
        )
    from devices.iio.accelerometer import IioAccelerometer

    return IioAccelerometer(
        device.name,
        clock=clock,
        odr_hz=device.odr_hz,
        range_g=device.range_g,
        trigger=device.trigger,
        block_samples=block,
        serial=device.serial,
    )


def _make_witmotion(device: WitMotionDevice, block: int, clock: Clock) -> Device:
    from devices.serial.witmotion import open_witmotion

    return open_witmotion(
        device.port,
        device.baud,
        clock=clock,
        odr_hz=device.odr_hz,
        frames=device.frames,
        block_samples=block,
        serial=device.serial,
    )


def _make_node(device: NodeDevice, block: int, clock: Clock) -> Device:
    from devices.serial.node import open_node

    return open_node(
        device.port,
        device.baud,
        node=device.node,
        clock=clock,
        odr_hz=device.odr_hz,
        range_g=device.range_g,
        block_samples=block,
        serial=device.serial,
    )


def _make_aspp(device: AsppDevice, block: int, clock: Clock) -> Device:
    from devices.serial.aspp import open_aspp

    return open_aspp(
        device.port,
        device.baud,
        node=device.node,
        clock=clock,
        range_g=device.range_g,
        odr_hz=device.odr_hz,
        channels=device.channels,
        units_per_g=device.units_per_g,
        block_samples=block,
        serial=device.serial,
    )


def _make_replay(device: ReplayDevice, block: int, clock: Clock) -> Device:
    from gateway.daemon.sampling.replay_source import open_replay

    return open_replay(device, block, clock)


Maker = Callable[[Any, int, Clock], Device]
_MAKERS: dict[type[DeviceSection], Maker] = {
    I2cDevice: _make_chip,
    Ads1115Device: _make_ads1115,
    IioDevice: _make_iio,
    SingleAxisDevice: _make_combined,
    WitMotionDevice: _make_witmotion,
    NodeDevice: _make_node,
    AsppDevice: _make_aspp,
    ReplayDevice: _make_replay,
}
"""What makes the devices of a section. The simulated crane also wants the rest of the configuration, and others are plugins."""


def run_hook(command: list[str]) -> bool:
    """Run a command for at most five seconds; return whether it ended with exit code 0."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=HOOK_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        log.error("recovery command %s failed: %s; check the configuration of the device", command[0], error)
        return False
    if done.returncode:
        output = (done.stderr or done.stdout).strip().splitlines()
        log.error("recovery command %s: exit code %d, %s", command[0], done.returncode, output[-1] if output else "-")
        return False
    log.warning("recovery command %s was run", command[0])
    return True


class SimulatedRigger:
    """Follows the session as a person at the hook follows the page."""

    def __init__(self, crane: "SimulatedCrane") -> None:
        self._crane = crane
        self._direction: tuple[float, ...] | None = None
        self._is_off_rope = False

    def follow(self, session: CalibrationSession) -> None:
        """Turn the housing to the next face, or hang it back on the rope after the session."""
        if session.suspended and session.phase == "collecting" and session.next_direction is not None:
            direction = tuple(session.next_direction)
            if direction != self._direction:
                self._crane.turn_housing(direction)
                self._direction, self._is_off_rope = direction, True
        elif self._is_off_rope and not session.suspended:
            self._crane.hang_housing()
            self._direction, self._is_off_rope = None, False


def make_rigger(configuration: Configuration, device: Device) -> SimulatedRigger | None:
    """Return the rigger of the simulated crane; None where a person turns the housing."""
    if configuration.device.kind != "simulated":
        return None
    from devices.simulated.device import SimulatedCrane

    return SimulatedRigger(device) if isinstance(device, SimulatedCrane) else None
