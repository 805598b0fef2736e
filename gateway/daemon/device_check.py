"""The checks of `plumbline doctor --device`: what is on the bus, the self-test of the part, and what it reads."""

from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

from smbus2 import SMBus

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import Device
from devices.errors import DeviceError
from devices.i2c import BusOpener
from devices.i2c_probe import FoundPart, probe_bus
from devices.self_test import SelfTestResult, run_self_test
from gateway.configuration.i2c_devices import I2cDevice, I2cSection
from gateway.configuration.model import Configuration
from gateway.configuration.serial_devices import SerialSection
from gateway.daemon.check_result import CheckResult, Grade
from gateway.daemon.face_check import check_attitude
from gateway.daemon.serial_check import examine_ports, examine_radio

READING_S = 3.0
RATE_TOLERANCE = 0.1

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
    good = abs(rate_hz / info.odr_hz - 1) <= RATE_TOLERANCE
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
