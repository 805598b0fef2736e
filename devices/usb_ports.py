"""The serial ports of USB adapters, by the identity that an adapter keeps when its number changes.

The kernel states vendor, product and serial number of a USB device in sysfs, above the device of the terminal. This is what
`serial.tools.list_ports` reads too; here the folders can be chosen, so that a test can plug an adapter in.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from devices.errors import DeviceNotFoundError

PATTERN = re.compile(r"usb:([0-9a-fA-F]{4}):([0-9a-fA-F]{4})(?::(.+))?")
MAX_LEVELS = 4
"""The USB device is at most this far above the device of the terminal. Basis: port, interface, device."""


@dataclass(frozen=True, slots=True)
class PortFolders:
    """Where the system names serial ports; tests provide their own."""

    by_id: Path = Path("/dev/serial/by-id")
    """Persistent names, made by udev."""
    terminals: Path = Path("/sys/class/tty")
    dev: Path = Path("/dev")


SYSTEM_FOLDERS = PortFolders()


@dataclass(frozen=True, slots=True)
class UsbPort:
    """A serial port of a USB adapter."""

    path: Path
    vendor: str
    product: str
    serial: str | None
    """Serial number of the adapter; cheap ones have none."""
    model: str

    @property
    def name(self) -> str:
        """The port as the configuration names it: `usb:VID:PID:SERIAL`."""
        return ":".join(["usb", self.vendor, self.product, *([self.serial] if self.serial else [])])

    def __str__(self) -> str:
        return f"{self.path} is {self.name} ({self.model})"


def find_usb_ports(folders: PortFolders) -> list[UsbPort]:
    """Return the ports of all USB adapters that are plugged in, in order of their paths."""
    entries = sorted(folders.terminals.iterdir()) if folders.terminals.is_dir() else []
    ports = (_usb_port(folders.dev / entry.name, (entry / "device").resolve()) for entry in entries)
    return [port for port in ports if port is not None and port.path.exists()]


def find_usb_port(name: str, folders: PortFolders) -> UsbPort:
    """Return the port with the identity `usb:VID:PID` or `usb:VID:PID:SERIAL`.

    Raises `DeviceNotFoundError` where there is none or more than one, and `ValueError` for another form.
    """
    match = PATTERN.fullmatch(name)
    if match is None:
        raise ValueError(f"port {name!r} is not of the form usb:VID:PID:SERIAL, with four hexadecimal digits each")
    vendor, product, serial = match[1].lower(), match[2].lower(), match[3]
    ports = find_usb_ports(folders)
    found = [
        port for port in ports if (port.vendor, port.product) == (vendor, product) and serial in (None, port.serial)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        raise DeviceNotFoundError(
            f"{name}: several adapters have this identity ({_list(found)}); add the serial number, or use /dev/serial/by-id"
        )
    raise DeviceNotFoundError(f"{name}: no such adapter; plug it in, or name another: there is {_list(ports)}")


def _list(ports: list[UsbPort]) -> str:
    return ", ".join(map(str, ports)) or "none"


def _usb_port(path: Path, device: Path) -> UsbPort | None:
    for folder in (device, *device.parents[:MAX_LEVELS]):
        vendor, product = _read(folder / "idVendor"), _read(folder / "idProduct")
        if vendor and product:
            return UsbPort(path, vendor, product, _read(folder / "serial"), _read(folder / "product") or "no name")
    return None


def _read(path: Path) -> str | None:
    try:
        return path.read_text(errors="replace").strip() or None
    except OSError:
        return None
