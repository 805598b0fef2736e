"""A USB adapter is found by its identity, whatever name its port has."""

import os
import pty
from collections.abc import Iterator
from pathlib import Path

import pytest

from devices.errors import DeviceError, DeviceNotFoundError, TransferError
from devices.serial_port import SerialPort, find_usb_port, find_usb_ports
from tests.devices.usb_tree import UsbTree


class Terminal:
    """A pseudo-terminal."""

    def __init__(self) -> None:
        self.master, slave = pty.openpty()
        self.path = os.ttyname(slave)
        os.close(slave)


@pytest.fixture
def tree(tmp_path: Path) -> UsbTree:
    return UsbTree(tmp_path)


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    made = [Terminal() for _ in range(3)]
    yield made
    for terminal in made:
        os.close(terminal.master)


def test_every_adapter_is_listed(tree: UsbTree, terminals: list[Terminal]) -> None:
    assert find_usb_ports(tree.folders) == []
    tree.plug_in("ttyUSB0", terminals[0].path)
    tree.plug_in("ttyACM0", terminals[1].path, "1a86:7523", serial=None)
    (tree.folders.terminals / "ttyS0").mkdir()  # a port of the board has no USB device
    assert [str(port) for port in find_usb_ports(tree.folders)] == [
        f"{tree.folders.dev}/ttyACM0 is usb:1a86:7523 (FT231X USB UART)",
        f"{tree.folders.dev}/ttyUSB0 is usb:0403:6015:DN01 (FT231X USB UART)",
    ]


def test_a_machine_without_terminals_has_no_ports(tmp_path: Path) -> None:
    tree = UsbTree(tmp_path)
    tree.folders.terminals.rmdir()
    assert find_usb_ports(tree.folders) == []


@pytest.mark.parametrize("name", ["usb:0403:6015:DN02", "usb:0403:6015", "usb:0403:6015:DN01"])
def test_an_adapter_that_is_not_unique_or_absent_is_refused(
    tree: UsbTree, terminals: list[Terminal], name: str
) -> None:
    tree.plug_in("ttyUSB0", terminals[0].path)
    tree.plug_in("ttyUSB1", terminals[1].path, serial="DN03")
    if name.endswith("DN01"):
        assert find_usb_port(name, tree.folders).path.name == "ttyUSB0"
        return
    with pytest.raises(DeviceNotFoundError, match=r"no such adapter; .*DN01.*DN03|several adapters.*add the serial"):
        find_usb_port(name, tree.folders)


@pytest.mark.parametrize("name", ["usb:403:6015", "usb:0403", "usb:0403:60x5:A", "usb:0403:6015:"])
def test_another_form_is_refused(tree: UsbTree, name: str) -> None:
    with pytest.raises(ValueError, match="not of the form usb:VID:PID:SERIAL"):
        find_usb_port(name, tree.folders)


@pytest.mark.slow
@pytest.mark.parametrize("by_id", [None, "usb-FTDI_FT231X_DN01-if00-port0"])
@pytest.mark.parametrize("named", ["usb", "path"])
def test_a_port_is_found_again_under_another_number(
    tree: UsbTree, terminals: list[Terminal], named: str, by_id: str | None
) -> None:
    """Another adapter has taken the old number."""
    tree.plug_in("ttyUSB0", terminals[0].path, by_id=by_id)
    name = "usb:0403:6015:DN01" if named == "usb" else str(tree.folders.dev / "ttyUSB0")
    port = SerialPort(name, 115200, tree.folders)
    port.open(0.2)
    identity = port.identity
    assert identity == (by_id or "usb-0403-6015-DN01")
    os.write(terminals[0].master, b"one")
    assert port.read(3) == b"one"
    tree.unplug("ttyUSB0")
    with pytest.raises(TransferError, match="the port has gone"):
        port.read(3)
    with pytest.raises(DeviceError, match=r"no such (adapter|port)"):
        port.open(0.2)
    tree.plug_in("ttyUSB0", terminals[2].path, serial="OTHER", by_id="usb-other" if by_id else None)
    tree.plug_in("ttyUSB3", terminals[1].path, by_id=by_id)
    port.open(0.2)
    os.write(terminals[1].master, b"two")
    assert port.read(3) == b"two"
    assert port.identity == identity
    port.close()


def test_a_write_needs_no_time_and_one_that_does_not_fit_is_reported(tree: UsbTree, terminals: list[Terminal]) -> None:
    port = SerialPort(terminals[0].path, 115200, tree.folders)
    port.open(1e-9)
    port.write(b"ask")
    assert os.read(terminals[0].master, 3) == b"ask"
    with pytest.raises(TransferError, match="takes no more bytes"):
        port.write(bytes(1_000_000))
    port.close()


def test_a_write_reaches_the_sensor_and_a_lost_port_is_reported(tree: UsbTree, terminals: list[Terminal]) -> None:
    port = SerialPort(terminals[0].path, 115200, tree.folders)
    with pytest.raises(TransferError, match="the port is not open"):
        port.write(b"x")
    port.open(0.2)
    port.write(b"ask")
    assert os.read(terminals[0].master, 3) == b"ask"
    gone = Terminal()
    port = SerialPort(gone.path, 115200, tree.folders)
    port.open(0.2)
    os.close(gone.master)
    with pytest.raises(TransferError, match="takes no bytes"):
        port.write(b"x")
    port.close()
