"""The checks of `plumbline doctor --device`: what is on the bus or the port, the self-test of the part, and what it reads."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from smbus2 import SMBus

from devices.axes_map import AxesMap
from devices.block import DeviceInfo, RadioStatus, SampleBlock
from devices.clock import Clock
from devices.device import Device
from devices.errors import DeviceError, DeviceNotFoundError
from devices.i2c.bus import BusOpener, FoundPart, probe_bus
from devices.i2c.self_test import SelfTestResult, run_self_test
from devices.serial_port import SYSTEM_FOLDERS, PortFolders, find_usb_port, find_usb_ports
from gateway.configuration.device_sections import I2cDevice, I2cSection, SerialSection
from gateway.configuration.model import Configuration
from gateway.daemon.doctor import CheckResult, Grade

READING_S = 3.0
"""Time for which the device is read. Basis: a choice; a rate within a few per cent, and no long wait for a person."""
MAX_REPORTED_RATE_DIFFERENCE = 0.1
"""Relative difference from the nominal rate. Basis: oscillators differ by some per cent; the next rate of a part differs by a
factor of two."""
SCALE_TOLERANCE = 0.1
"""Relative tolerance of the magnitude at rest, besides the zero-g offsets of the data sheet."""
FACE_UP_G = 0.8
"""Least share of one g along the axis that points up. Basis: a choice; a tilt of 37 degrees, below the 45 degrees at which
another axis points up as much."""
MakeDevice = Callable[[Configuration, Clock], Device]


def examine_device(
    configuration: Configuration, make_device: MakeDevice, clock: Clock, open_bus: BusOpener = SMBus
) -> Iterator[CheckResult]:
    """Probe the bus, run the self-test, and read for three seconds; the sensor must rest. Yields each result at once."""
    section = configuration.device
    if isinstance(section, SerialSection):
        yield from examine_ports(section)
    if isinstance(section, I2cSection):
        yield from _probe(section, clock, open_bus)
    if isinstance(section, I2cDevice):
        yield from check_self_test(section, clock, open_bus)
    yield from _reading(configuration, make_device, clock)


def _probe(section: I2cSection, clock: Clock, open_bus: BusOpener) -> Iterator[CheckResult]:
    place = f"/dev/i2c-{section.bus}"
    try:
        found = list(probe_bus(section.bus, clock, open_bus))
    except DeviceError as error:
        others = ", ".join(sorted(str(path) for path in Path("/dev").glob("i2c-*")))
        yield CheckResult("bad", "probe", f"{error}; this machine has {others or 'no I2C bus'}")
        return
    if not found:
        yield CheckResult("bad", "probe", f"{place}: no known part answers; check supply, SDA and SCL")
    for part in found:
        yield CheckResult("note" if part.error else "good", "probe", f"{place} {_description(part)}")
    if found and section.address not in [part.address for part in found]:
        addresses = ", ".join(f"{part.address:#04x}" for part in found)
        text = f"{place}: nothing at device.address {section.address:#04x}; parts answer at {addresses}"
        yield CheckResult("bad", "probe", text)


def _description(part: FoundPart) -> str:
    if part.error is not None:
        return part.error
    return f"{part.address:#04x}: {'an unknown part' if part.identity is None else part.identity.name}"


def check_self_test(section: I2cDevice, clock: Clock, open_bus: BusOpener) -> Iterator[CheckResult]:
    """Run the self-test of the configured part; yields one result."""
    test = section.chip(section.odr_hz, section.range_g).self_test
    if test is None:
        yield CheckResult("note", "self-test", f"no limits are known for the {section.chip.part}")
        return
    try:
        result = run_self_test(section.chip, test, section.bus, section.address, clock=clock, open_bus=open_bus)
    except DeviceError as error:
        yield CheckResult("bad", "self-test", str(error))
        return
    yield CheckResult(_grade(result), "self-test", _self_test_text(result), {**asdict(result), "passed": result.passed})


def _grade(result: SelfTestResult) -> Grade:
    if result.passed:
        return "good"
    return "bad" if result.confirmed else "note"


def _self_test_text(result: SelfTestResult) -> str:
    axes = ", ".join(
        f"{axis} {change:+.3f} g ({low:g} to {high:g})"
        for axis, change, (low, high) in zip("xyz", result.change_g, result.limits_g, strict=True)
    )
    advice = "" if result.passed else "; beyond the limits: repeat it at rest, then replace the sensor"
    return f"change by the self-test: {axes}{advice}"


def _reading(configuration: Configuration, make_device: MakeDevice, clock: Clock) -> Iterator[CheckResult]:
    try:
        device = make_device(configuration, clock)
        info = device.open()
        try:
            blocks = read_blocks(device, clock, READING_S)
        finally:
            device.close()
    except DeviceError as error:
        yield CheckResult("bad", "reading", str(error))
        return
    if not blocks:
        yield CheckResult("bad", "reading", f"{info.device_id}: no samples in {READING_S:g} s")
        return
    yield _rate(info, blocks)
    yield from check_attitude(info, configuration.device.axes, blocks)
    yield from examine_radio(blocks)
    if faults := {name: count for name, count in device.faults.items() if count}:
        yield CheckResult("note", "faults", ", ".join(f"{name} {count}" for name, count in faults.items()))


def read_blocks(device: Device, clock: Clock, duration_s: float) -> list[SampleBlock]:
    """Return what an open device delivers in a time. Raises `DeviceError`."""
    end_ns = clock.now_ns() + round(duration_s * 1e9)
    blocks = []
    while clock.now_ns() < end_ns:
        block = device.read()
        if block is not None and len(block):
            blocks.append(block)
    return blocks


def _rate(info: DeviceInfo, blocks: list[SampleBlock]) -> CheckResult:
    samples = sum(len(block) + block.lost for block in blocks) - blocks[0].lost
    duration_s = (blocks[-1].time_ns[-1] - blocks[0].time_ns[0]) / 1e9
    rate_hz = (samples - 1) / duration_s if samples > 1 else 0.0
    good = abs(rate_hz / info.odr_hz - 1) <= MAX_REPORTED_RATE_DIFFERENCE
    temperatures = [block.temperature_c for block in blocks if block.temperature_c is not None]
    temperature = f", {temperatures[-1]:.1f} °C" if temperatures else ""
    text = f"{info.device_id}: {rate_hz:.4g} samples/s, nominal {info.odr_hz:g}{temperature}"
    values = {
        "device_id": info.device_id,
        "samples": samples,
        "rate_hz": rate_hz,
        "nominal_rate_hz": info.odr_hz,
        "temperature_c": temperatures[-1] if temperatures else None,
    }
    return CheckResult("good" if good else "bad", "reading", text, values)


def examine_ports(section: SerialSection, folders: PortFolders = SYSTEM_FOLDERS) -> Iterator[CheckResult]:
    """State the USB adapters of this machine, and which one is configured."""
    ports = find_usb_ports(folders)
    values = [asdict(port) | {"path": str(port.path), "name": port.name} for port in ports]
    listed = "; ".join(map(str, ports)) or "none"
    yield CheckResult("note", "ports", f"USB adapters with a serial port: {listed}", {"adapters": values})
    if section.port.startswith("usb:"):
        try:
            found = find_usb_port(section.port, folders)
        except DeviceNotFoundError as error:
            yield CheckResult("bad", "ports", str(error))
            return
        yield CheckResult("good", "ports", f"{section.port} is {found.path}")


def examine_radio(blocks: Sequence[SampleBlock]) -> Iterator[CheckResult]:
    """State the battery and the signal that a wireless sensor has reported; nothing for a sensor with a cable."""
    reported: dict[str, Any] = {}
    for block in blocks:
        if block.radio is not None:
            reported |= {name: value for name, value in asdict(block.radio).items() if value is not None}
    if not reported:
        return
    status = RadioStatus(**reported)
    parts = [
        "" if status.battery_v is None else f"battery {status.battery_v:.2f} V",
        "" if status.battery_percent is None else f"{status.battery_percent:.0f} % charged",
        "battery is low: charge or change it" if status.battery_low else "",
        "" if status.signal_dbm is None else f"signal {status.signal_dbm:.0f} dBm",
    ]
    text = ", ".join(part for part in parts if part) or "battery is not low"
    yield CheckResult("note" if status.battery_low else "good", "radio", text, asdict(status))


def check_attitude(info: DeviceInfo, axes: AxesMap, blocks: list[SampleBlock]) -> Iterator[CheckResult]:
    """Say which face of the housing is up in readings at rest, with a sketch, and whether their magnitude is one g."""
    sensor_g: NDArray[np.float64] = np.concatenate([block.raw for block in blocks]).mean(axis=0) / info.units_per_g
    magnitude_g = float(np.linalg.norm(sensor_g))
    tolerance_g = 3**0.5 * (info.zero_g_offset_g or 0.0) + SCALE_TOLERANCE
    if abs(magnitude_g - 1) > tolerance_g:
        possible = f"{max(1 - tolerance_g, 0):.2f} to {1 + tolerance_g:.2f} is possible"
        text = f"{magnitude_g:.3f} g at rest, {possible}; check kind and range"
        yield CheckResult("bad", "reading", text, {"sensor_g": sensor_g.tolist(), "magnitude_g": magnitude_g})
        return
    housing_g = np.array([sign * sensor_g[index] for index, sign in axes])
    readings = ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", housing_g, strict=True))
    values = {"housing_g": housing_g.tolist(), "magnitude_g": magnitude_g}
    largest = int(np.abs(housing_g).argmax())
    up = ("-" if housing_g[largest] < 0 else "+") + "xyz"[largest]
    upright = largest == 2 and housing_g[2] > FACE_UP_G
    advice = "" if upright else "; on the rope +z must point up: turn the housing or set device.axes_map"
    text = f"the housing's {up} face is up ({readings} g){advice}"
    sketch = sketch_housing(largest, -1 if housing_g[largest] < 0 else 1, axes)
    yield CheckResult("good" if upright else "note", "attitude", text, values, sketch)


def sketch_housing(axis: int, sign: int, axes: AxesMap) -> tuple[str, ...]:
    """Return the lines of a sketch of the housing, one face of which is up, and where the sensor's axes are in it.

    The faces in front and on the right are those of a housing that was turned the shortest way.
    """
    up, right = (axis, sign), ((axis + 1) % 3, 1)
    front = (axis + 2) % 3, -sign  # up, right and back are right-handed
    sensor = [f"{'-' if turned < 0 else '+'}{'xyz'[index]}" for index, turned in axes]
    names = ", ".join(f"{name} is {each}" for name, each in zip("xyz", sensor, strict=True))
    return (
        "   +--------+     up",
        f"  /   {_face(up)}  /|     ^",
        " +--------+ |     |",
        f" |        |{_face(right)}",
        f" |   {_face(front)}   | +     faces of the housing",
        " |        |/      by the sensor's axes: " + names,
        " +--------+",
    )


def _face(face: tuple[int, int]) -> str:
    return f"{'-' if face[1] < 0 else '+'}{'xyz'[face[0]]}"
