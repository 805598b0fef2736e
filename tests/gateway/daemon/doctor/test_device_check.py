"""`plumbline doctor --device` against models of the chips at the bus, and for sensors on a serial port."""

import os
import pty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.axes_map import SAME_AXES
from devices.block import RadioStatus, SampleBlock
from devices.clock import Clock
from devices.device import Device
from devices.i2c.chips import CHIPS
from devices.i2c.fifo_accelerometer import FifoAccelerometer
from gateway.configuration.device_sections import I2cDevice, NodeDevice
from gateway.configuration.loading import validate
from gateway.configuration.model import Configuration
from gateway.daemon.doctor import CheckResult
from gateway.daemon.doctor.device_check import (
    check_self_test,
    examine_device,
    examine_ports,
    examine_radio,
    sketch_housing,
)
from tests.devices.i2c.adxl345_chip import Adxl345Chip
from tests.devices.i2c.adxl355_chip import Adxl355Chip, Adxl357Chip
from tests.devices.i2c.chip_bus import ChipBus
from tests.devices.i2c.i2c_chip import FakeClock, I2cChip
from tests.devices.i2c.lis3dh_chip import Lis3dhChip
from tests.devices.usb_tree import UsbTree


def results_of(device: dict[str, Any], *chips: I2cChip) -> list[CheckResult]:
    clock = chips[0].clock
    bus = ChipBus(clock, *chips)

    def make(configuration: Configuration, clock: Clock) -> Device:
        section = configuration.device
        assert isinstance(section, I2cDevice)
        chip = CHIPS[section.kind](section.odr_hz, section.range_g)
        return FifoAccelerometer(chip, section.bus, section.address, clock=clock, open_bus=bus)

    return list(examine_device(validate({"device": device}, "test"), make, clock, bus))


def examined(device: dict[str, Any], *chips: I2cChip) -> dict[str, list[tuple[str, str]]]:
    """Results by place: grade and text."""
    results: dict[str, list[tuple[str, str]]] = {}
    for result in results_of(device, *chips):
        results.setdefault(result.place, []).append((result.grade, result.text))
    return results


def test_a_good_part_is_found_tested_and_read() -> None:
    chip = Adxl355Chip(FakeClock(0.0001), lambda _: (0.02, -0.01, 1.0))
    results = examined({"kind": "adxl355"}, chip)
    assert results["probe"] == [("good", "/dev/i2c-1 0x1d: ADXL355")]
    assert results["self-test"] == [
        ("good", "change by the self-test: x +0.300 g (0.1 to 0.6), y +0.300 g (0.1 to 0.6), z +1.000 g (0.5 to 3)")
    ]
    assert results["reading"] == [("good", "adxl355-01-i2c1-1d: 125 samples/s, nominal 125, 25.0 °C")]
    assert results["attitude"] == [("good", "the housing's +z face is up (x +0.020, y -0.010, z +1.000 g)")]
    assert "faults" not in results


def test_a_part_at_another_address_is_named() -> None:
    results = examined({"kind": "adxl355"}, Adxl355Chip(FakeClock(), address=0x53))
    assert results["probe"][0] == ("good", "/dev/i2c-1 0x53: ADXL355")
    assert results["probe"][1] == ("bad", "/dev/i2c-1: nothing at device.address 0x1d; parts answer at 0x53")
    assert results["reading"][0][0] == "bad"


def test_another_part_at_the_address_is_named() -> None:
    results = examined({"kind": "adxl355"}, Adxl345Chip(FakeClock(), address=0x1D))
    assert results["probe"] == [("good", "/dev/i2c-1 0x1d: ADXL345")]
    assert "this is an ADXL345" in results["reading"][0][1]


def test_a_part_whose_self_test_fails_is_bad() -> None:
    chip = Lis3dhChip(FakeClock(), lambda _: (0.0, 0.0, 1.0))
    chip.self_test_g = (0.3, 0.0, 0.3)
    results = examined({"kind": "lis3dh"}, chip)
    assert results["self-test"][0][0] == "bad"
    assert "y +0.000 g (0.068 to 1.44)" in results["self-test"][0][1]


def test_the_self_test_is_recorded_with_its_limits() -> None:
    clock = FakeClock()
    chip = Adxl355Chip(clock, lambda _: (0.0, 0.0, 1.0))
    section = validate({"device": {"kind": "adxl355"}}, "test").device
    assert isinstance(section, I2cDevice)
    (result,) = check_self_test(section, clock, ChipBus(clock, chip))
    assert result.values["change_g"] == pytest.approx([0.3, 0.3, 1.0], abs=1e-3)
    assert result.values["limits_g"] == ((0.1, 0.6), (0.1, 0.6), (0.5, 3.0))
    assert (result.values["passed"], result.values["confirmed"]) == (True, True)


@pytest.mark.slow
def test_limits_from_one_source_give_a_note_only() -> None:
    chip = Adxl345Chip(FakeClock(), lambda _: (0.0, 0.0, 1.0))
    chip.self_test_g = (0.0, 0.0, 0.0)
    assert examined({"kind": "adxl345"}, chip)["self-test"][0][0] == "note"


def test_the_wrong_member_of_a_family_shows_in_the_magnitude() -> None:
    """An ADXL357 configured as an ADXL355 has the right identity and a fifth of the reading."""
    results = examined({"kind": "adxl355"}, Adxl357Chip(FakeClock(), lambda _: (0.0, 0.0, 1.0)))
    assert results["probe"] == [("good", "/dev/i2c-1 0x1d: ADXL355")]
    assert results["reading"][1] == ("bad", "0.200 g at rest, 0.77 to 1.23 is possible; check kind and range")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force_g", "face"), [((0.0, 1.0, 0.1), "+y"), ((-0.99, 0.0, 0.1), "-x"), ((0.0, 0.1, -1.0), "-z")]
)
def test_a_housing_that_does_not_hang_upright_is_described(force_g: tuple[float, float, float], face: str) -> None:
    results = examined({"kind": "adxl355"}, Adxl355Chip(FakeClock(), lambda _: force_g))
    grade, text = results["attitude"][0]
    assert grade == "note"
    assert f"the housing's {face} face is up" in text
    assert "set device.axes_map" in text


def test_the_sketch_shows_the_face_that_is_up_and_the_axes_of_the_sensor() -> None:
    chip = Adxl355Chip(FakeClock(), lambda _: (-1.0, 0.0, 0.0))
    attitude = next(result for result in results_of({"kind": "adxl355", "axes_map": "z,-y,x"}, chip) if result.sketch)
    top, front = attitude.sketch[1], attitude.sketch[4]
    assert "-z" in top
    assert "+y" in front
    assert "+x" in attitude.sketch[3]
    assert attitude.sketch[5].endswith("x is +z, y is -y, z is +x")


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_the_faces_of_the_sketch_are_right_handed(axis: int, sign: int) -> None:
    lines = sketch_housing(axis, sign, SAME_AXES)
    up, right, front = (_direction(lines[row][column : column + 2]) for row, column in ((1, 6), (3, 11), (4, 5)))
    assert np.array_equal(np.cross(right, -front), up)


def _direction(face: str) -> NDArray[np.float64]:
    found: NDArray[np.float64] = np.eye(3)["xyz".index(face[1])] * (-1 if face[0] == "-" else 1)
    return found


def test_the_axes_map_is_applied() -> None:
    chip = Adxl355Chip(FakeClock(), lambda _: (1.0, 0.0, 0.0))
    results = examined({"kind": "adxl355", "axes_map": "z,-y,x"}, chip)
    assert results["attitude"][0][0] == "good"
    assert "+z face is up" in results["attitude"][0][1]


def test_a_rate_far_from_the_nominal_one_is_bad() -> None:
    chip = Adxl355Chip(FakeClock(0.0001), lambda _: (0.0, 0.0, 1.0), rate_error=-0.2)
    grade, text = examined({"kind": "adxl355"}, chip)["reading"][0]
    assert grade == "bad"
    assert "nominal 125" in text


def test_an_empty_bus_is_reported() -> None:
    chip = Adxl355Chip(FakeClock(), address=0x42)
    results = examined({"kind": "adxl355"}, chip)
    assert results["probe"] == [("bad", "/dev/i2c-1: no known part answers; check supply, SDA and SCL")]


def test_a_missing_bus_is_reported() -> None:
    results = examined({"kind": "adxl355", "bus": 5}, Adxl355Chip(FakeClock()))
    assert results["probe"][0][0] == "bad"
    assert "/dev/i2c-5: no such bus" in results["probe"][0][1]


@pytest.fixture
def terminal() -> Iterator[str]:
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(slave)
    os.close(master)


def section(port: str) -> NodeDevice:
    return NodeDevice(kind="node", node=7, port=port)


def lines(results: Iterator[CheckResult]) -> list[tuple[str, str]]:
    return [(result.grade, result.text) for result in results]


def test_adapters_are_listed_and_the_configured_one_is_named(tmp_path: Path, terminal: str) -> None:
    tree = UsbTree(tmp_path)
    tree.plug_in("ttyUSB4", terminal)
    listed = f"USB adapters with a serial port: {tree.folders.dev}/ttyUSB4 is usb:0403:6015:DN01 (FT231X USB UART)"
    assert lines(examine_ports(section("usb:0403:6015:DN01"), tree.folders)) == [
        ("note", listed),
        ("good", f"usb:0403:6015:DN01 is {tree.folders.dev}/ttyUSB4"),
    ]
    assert lines(examine_ports(section("/dev/ttyUSB4"), tree.folders)) == [("note", listed)]


def test_an_adapter_that_is_not_there_is_bad(tmp_path: Path) -> None:
    results = lines(examine_ports(section("usb:0403:6015"), UsbTree(tmp_path).folders))
    assert results[0] == ("note", "USB adapters with a serial port: none")
    assert results[1][0] == "bad"
    assert "no such adapter; plug it in" in results[1][1]


def block(radio: RadioStatus | None) -> SampleBlock:
    return SampleBlock(np.array([1], np.int64), np.zeros((1, 3)), radio=radio)


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (RadioStatus(3.71, 30.0, False, -67.0), ("good", "battery 3.71 V, 30 % charged, signal -67 dBm")),
        (RadioStatus(3.31, None, True, None), ("note", "battery 3.31 V, battery is low: charge or change it")),
        (RadioStatus(battery_low=False), ("good", "battery is not low")),
    ],
)
def test_battery_and_signal_are_stated(status: RadioStatus, expected: tuple[str, str]) -> None:
    assert lines(examine_radio([block(status), block(None)])) == [expected]


def test_a_sensor_with_a_cable_has_neither() -> None:
    assert lines(examine_radio([block(None)])) == []
