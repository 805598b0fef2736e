"""From configuration to device: the one place that knows every kind."""

import math

from devices.adxl355 import Adxl355
from devices.clock import Clock
from devices.device import Device
from devices.errors import RecordingError
from devices.simulated.device import SimulatedCrane
from devices.witmotion import WitMotion
from gateway.configuration.model import (
    Adxl355Device,
    Configuration,
    ReplayDevice,
    SimulatedDevice,
    WitMotionDevice,
)

BLOCK_S = 0.05
"""Dwell of a block where its length is not configured."""
LONGEST_BLOCK = 32


def block_samples(configuration: Configuration) -> int:
    """Samples per block: as configured, else 50 ms' worth and at most 32."""
    device = configuration.device
    if device.block_samples is not None:
        return device.block_samples
    rate_hz = getattr(device, "odr_hz", None)
    return LONGEST_BLOCK if rate_hz is None else max(1, min(LONGEST_BLOCK, math.ceil(rate_hz * BLOCK_S)))


def make_device(configuration: Configuration, clock: Clock) -> Device:
    """The configured device, not yet opened. Raises `DeviceError` for a recording that cannot be read."""
    device, n = configuration.device, block_samples(configuration)
    match device:
        case SimulatedDevice():
            return SimulatedCrane(
                odr_hz=device.odr_hz,
                range_g=device.range_g,
                block_samples=n,
                seed=device.seed,
                length_m=configuration.rope.length_m,
                position_m=configuration.housing_position_m,
                gravity_m_s2=configuration.site.local_gravity_m_s2,
                clock=clock,
            )
        case Adxl355Device():
            return Adxl355(
                bus=device.bus,
                address=device.address,
                odr_hz=device.odr_hz,
                range_g=device.range_g,
                block_samples=n,
                clock=clock,
                serial=device.serial,
            )
        case WitMotionDevice():
            return WitMotion(port=device.port, baud=device.baud, odr_hz=device.odr_hz, block_samples=n, clock=clock)
        case ReplayDevice():
            return open_replay(device, n, clock)
