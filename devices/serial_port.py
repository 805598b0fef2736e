"""A serial port that may be unplugged: it is opened by a persistent name, not by the number that the kernel assigned."""

import errno
from contextlib import suppress
from pathlib import Path

import serial

from devices.errors import GONE_ERRNOS, DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError
from devices.usb_ports import SYSTEM_FOLDERS, PortFolders, UsbPort, find_usb_port, find_usb_ports

READ_LIMIT = 4096
"""Bytes of a read. Basis: the size of the kernel's buffer of a port."""
DENIED_ERRNOS = (errno.EACCES, errno.EPERM)
BUSY_ERRNOS = (errno.EAGAIN, errno.EBUSY)


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

    @property
    def adapter(self) -> str | None:
        """The USB adapter of the open port, as the configuration can name it; None where the port has none."""
        return None if self._usb is None else self._usb.name

    def open(self, timeout_s: float) -> None:
        """Open the port exclusively and discard earlier bytes; a read waits at most `timeout_s`."""
        self.close()
        self._path = self._find()
        try:
            self._serial = serial.Serial(
                str(self._path), self.baud, timeout=timeout_s, write_timeout=timeout_s, exclusive=True
            )
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
        except OSError as error:  # includes the exceptions of pyserial
            raise TransferError(f"{self}: the port has gone ({error}); plug its adapter in again") from error
        if not data and not self._path.exists():
            raise TransferError(f"{self}: the port has gone; plug its adapter in again")
        return data

    def write(self, data: bytes) -> None:
        """Send bytes. Raises `TransferError` when the port has gone or takes none."""
        port = self._opened()
        try:
            port.write(data)
        except OSError as error:
            raise TransferError(f"{self}: the port takes no bytes ({error}); plug its adapter in again") from error

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
