"""`plumbline doctor --device` for sensors on a serial port."""

import os
import pty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from devices.block import RadioStatus, SampleBlock
from gateway.configuration.device_sections import NodeDevice
from gateway.daemon.doctor.check_result import CheckResult
from gateway.daemon.doctor.device_check import examine_ports, examine_radio
from tests.devices.usb_tree import UsbTree


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
