"""From configuration to device: the one place that knows every kind, and loads only the one that is wanted."""

import math

from devices.clock import Clock
from devices.device import Device
from devices.errors import DeviceError
from gateway.configuration.model import (
    Adxl355Device,
    Configuration,
    ReplayDevice,
    SimulatedDevice,
    WitMotionDevice,
)

BLOCK_S = 0.1
"""Dwell of a block where its length is not configured."""
LONGEST_BLOCK = 32


def block_samples(configuration: Configuration) -> int:
    """Samples per block: as configured, else a tenth of a second and at most 32."""
    device = configuration.device
    if device.block_samples is not None:
        return device.block_samples
    if isinstance(device, ReplayDevice):
        return LONGEST_BLOCK
    return max(1, min(LONGEST_BLOCK, math.ceil(device.odr_hz * BLOCK_S)))


def make_device(configuration: Configuration, clock: Clock) -> Device:
    """The configured device, not yet opened. Raises `DeviceError` where it cannot be made, such as from a torn recording."""
    n = block_samples(configuration)
    try:
        match configuration.device:
            case SimulatedDevice() as device:
                return _simulated(configuration, device, n, clock)
            case Adxl355Device() as device:
                return _adxl355(device, n, clock)
            case WitMotionDevice() as device:
                return _witmotion(device, n, clock)
            case ReplayDevice() as device:
                return _replay(device, n, clock)
    except ValueError as error:
        raise DeviceError(f"device: {error}") from error


def _simulated(configuration: Configuration, device: SimulatedDevice, block: int, clock: Clock) -> Device:
    from devices.simulated.device import SimulatedCrane

    position_m = configuration.housing_position_m
    if position_m is None:
        raise ValueError("where on the rope the simulated housing hangs is not given")
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


def _adxl355(device: Adxl355Device, block: int, clock: Clock) -> Device:
    from devices.adxl355 import Adxl355

    return Adxl355(
        bus=device.bus,
        address=device.address,
        odr_hz=device.odr_hz,
        range_g=device.range_g,
        block_samples=block,
        clock=clock,
        serial=device.serial,
    )


def _witmotion(device: WitMotionDevice, block: int, clock: Clock) -> Device:
    from devices.witmotion import WitMotion

    return WitMotion(
        port=device.port, baud=device.baud, odr_hz=device.odr_hz, block_samples=block, clock=clock, serial=device.serial
    )


def _replay(device: ReplayDevice, block: int, clock: Clock) -> Device:
    from gateway.daemon.replay_source import open_replay

    return open_replay(device, block, clock)
