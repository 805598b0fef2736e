"""The checks of `plumbline doctor --device` for sensors on a serial port: the adapters, battery and signal."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from devices.block import RadioStatus, SampleBlock
from devices.errors import DeviceNotFoundError
from devices.usb_ports import SYSTEM_FOLDERS, PortFolders, find_usb_port, find_usb_ports
from gateway.configuration.serial_devices import SerialSection
from gateway.daemon.check_result import CheckResult


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
