"""A serial port that may be unplugged: it is opened by a persistent name, not by the number that the kernel assigned.

That name is the identity of a USB adapter. The kernel states vendor, product and serial number of a USB device in sysfs, above
the device of the terminal. This is what `serial.tools.list_ports` reads too; here the folders can be chosen, so that a test can
plug an adapter in.
"""

import errno
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import serial

from devices.errors import GONE_ERRNOS, DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError

USB_NAME = re.compile(r"usb:([0-9a-fA-F]{4}):([0-9a-fA-F]{4})(?::(.+))?")
MAX_USB_LEVELS = 4
"""The USB device is at most this far above the device of the terminal. Basis: port, interface, device."""
READ_LIMIT = 4096
"""Bytes of a read. Basis: the size of the kernel's buffer of a port."""
DENIED_ERRNOS = (errno.EACCES, errno.EPERM)
BUSY_ERRNOS = (errno.EAGAIN, errno.EBUSY)


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
    match = USB_NAME.fullmatch(name)
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
            f"{name}: several adapters have this identity ({_list_names(found)}); add the serial number, or use /dev/serial/by-id"
        )
    raise DeviceNotFoundError(f"{name}: no such adapter; plug it in, or name another: there is {_list_names(ports)}")


def _list_names(ports: list[UsbPort]) -> str:
    return ", ".join(map(str, ports)) or "none"


def _usb_port(path: Path, device: Path) -> UsbPort | None:
    for folder in (device, *device.parents[:MAX_USB_LEVELS]):
        vendor, product = _read_attribute(folder / "idVendor"), _read_attribute(folder / "idProduct")
        if vendor and product:
            return UsbPort(
                path,
                vendor,
                product,
                _read_attribute(folder / "serial"),
                _read_attribute(folder / "product") or "no name",
            )
    return None


def _read_attribute(path: Path) -> str | None:
    try:
        return path.read_text(errors="replace").strip() or None
    except OSError:
        return None


class SerialPort:
    """Reads bytes; every failure is a `DeviceError` that names the port."""

    def __init__(self, name: str, baud: int, folders: PortFolders = SYSTEM_FOLDERS) -> None:
        """`name`: a path, or `usb:VID:PID:SERIAL`. `folders`: where a port is found again when its number has changed."""
        self._name = name
        self.baud = baud
        self._folders = folders
        self._path = Path(name)
        self._usb: UsbPort | None = None
        self._serial: serial.Serial | None = None

    def __str__(self) -> str:
        return str(self._path)

    @property
    def identity(self) -> str:
        """Persistent name of the port, with maker, model and serial number of the adapter where the system knows them."""
        if self._path.parent == self._folders.by_id or self._usb is None:
            return self._path.name
        return self._usb.name.replace(":", "-")

    def open(self, timeout_s: float) -> None:
        """Open the port exclusively and discard earlier bytes; a read waits at most `timeout_s`."""
        self.close()
        self._path = self._find()
        try:
            self._serial = serial.Serial(str(self._path), self.baud, timeout=timeout_s, exclusive=True)
        except ValueError as error:
            raise DeviceError(f"{self}: the port cannot do {self.baud} baud ({error}); set another rate") from error
        except serial.SerialException as error:
            raise self._open_error(error) from error
        self._usb = self._usb_port()
        self._path = self._persistent_name()

    def read(self, count: int) -> bytes:
        """Wait for `count` bytes and return all that are there, at most 4096; fewer after the timeout.

        Raises `TransferError` when the port has gone.
        """
        port = self._opened()
        try:
            waiting = port.in_waiting
            data: bytes = port.read(min(max(count, waiting), READ_LIMIT))
        except (OSError, ValueError) as error:  # pyserial's own, and where more than 1024 files are open
            raise TransferError(f"{self}: the port has gone ({error}); plug its adapter in again") from error
        if not data and not self._path.exists():
            raise TransferError(f"{self}: the port has gone; plug its adapter in again")
        return data

    def write(self, data: bytes) -> None:
        """Send bytes without waiting. Raises `TransferError` when the port has gone or does not take them all at once."""
        port = self._opened()
        try:
            # Not pyserial's own: its time limit also fails a write that succeeded while the system was busy.
            taken = os.write(port.fileno(), data)
        except OSError as error:
            raise TransferError(f"{self}: the port takes no bytes ({error}); plug its adapter in again") from error
        if taken < len(data):
            raise TransferError(f"{self}: the port takes no more bytes; plug its adapter in again")

    def close(self) -> None:
        """Release the port; may be called twice."""
        if self._serial is not None:
            with suppress(OSError):
                self._serial.close()
            self._serial = None

    def _opened(self) -> serial.Serial:
        if self._serial is None:
            raise TransferError(f"{self}: the port is not open; open it first")
        return self._serial

    def _find(self) -> Path:
        """Return the present path of the port: that of the same adapter where its number has changed."""
        if self._name.startswith("usb:"):
            return find_usb_port(self._name, self._folders).path
        if self._usb is not None and self._usb.serial and self._path.parent != self._folders.by_id:
            return find_usb_port(self._usb.name, self._folders).path
        return self._path

    def _usb_port(self) -> UsbPort | None:
        target = self._path.resolve()
        return next((port for port in find_usb_ports(self._folders) if port.path.resolve() == target), None)

    def _persistent_name(self) -> Path:
        return next((link for link in self._links() if link.resolve() == self._path.resolve()), self._path)

    def _links(self) -> list[Path]:
        return sorted(self._folders.by_id.iterdir()) if self._folders.by_id.is_dir() else []

    def _open_error(self, error: serial.SerialException) -> DeviceError:
        if error.errno in GONE_ERRNOS:
            offers = ", ".join(link.name for link in self._links()) or "nothing"
            return DeviceNotFoundError(
                f"{self}: no such port; plug its adapter in, or name another: {self._folders.by_id} offers {offers}"
            )
        if error.errno in DENIED_ERRNOS:
            return DeviceAccessError(
                f"{self}: may not be opened by this user; add it to the group dialout and log in again"
            )
        if error.errno in BUSY_ERRNOS:
            return DeviceAccessError(f"{self}: another program holds the port; stop it")
        if error.errno is None or error.errno == errno.EISDIR:
            return DeviceNotFoundError(
                f"{self}: is not a serial port; give one, preferably under {self._folders.by_id}"
            )
        return TransferError(f"{self}: the port does not open ({error}); plug its adapter out and in again")
