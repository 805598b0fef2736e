"""A serial port that may be unplugged: it is opened by a persistent name, not by the number that the kernel assigned."""

import errno
from contextlib import suppress
from pathlib import Path

import serial

from devices.errors import DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError

BY_ID = Path("/dev/serial/by-id")
READ_LIMIT = 4096
"""Size of the kernel's buffer of a port."""
GONE = (errno.ENOENT, errno.ENODEV, errno.ENXIO)
DENIED = (errno.EACCES, errno.EPERM)
BUSY = (errno.EAGAIN, errno.EBUSY)


class SerialPort:
    """Reads bytes; every failure is a `DeviceError` that names the port."""

    def __init__(self, path: str, baud: int, by_id: Path = BY_ID) -> None:
        """`by_id`: the folder of persistent names, by which a port is opened again when its number has changed."""
        self._path = Path(path)
        self._baud = baud
        self._by_id = by_id
        self._serial: serial.Serial | None = None

    def __str__(self) -> str:
        return str(self._path)

    @property
    def identity(self) -> str:
        """Persistent name of the port, with maker, model and serial number of the adapter where the system knows them."""
        return self._path.name

    def open(self, timeout_s: float) -> None:
        """Open the port exclusively and discard earlier bytes; a read waits at most `timeout_s`."""
        self.close()
        try:
            self._serial = serial.Serial(str(self._path), self._baud, timeout=timeout_s, exclusive=True)
        except ValueError as error:
            raise DeviceError(f"{self}: the port cannot do {self._baud} baud ({error}); set another rate") from error
        except serial.SerialException as error:
            raise self._open_error(error) from error
        self._path = self._persistent_name()

    def read(self, count: int) -> bytes:
        """Wait for `count` bytes and return all that are there, at most 4096; fewer after the timeout.

        Raises `TransferError` when the port has gone.
        """
        if self._serial is None:
            raise TransferError(f"{self}: the port is not open; open it first")
        try:
            waiting = self._serial.in_waiting
            data: bytes = self._serial.read(min(max(count, waiting), READ_LIMIT))
        except OSError as error:  # includes the exceptions of pyserial
            raise TransferError(f"{self}: the port has gone ({error}); plug its adapter in again") from error
        if not data and not self._path.exists():
            raise TransferError(f"{self}: the port has gone; plug its adapter in again")
        return data

    def close(self) -> None:
        """Release the port; may be called twice."""
        if self._serial is not None:
            with suppress(OSError):
                self._serial.close()
            self._serial = None

    def _persistent_name(self) -> Path:
        return next((link for link in self._links() if link.resolve() == self._path.resolve()), self._path)

    def _links(self) -> list[Path]:
        return sorted(self._by_id.iterdir()) if self._by_id.is_dir() else []

    def _open_error(self, error: serial.SerialException) -> DeviceError:
        if error.errno in GONE:
            offers = ", ".join(link.name for link in self._links()) or "nothing"
            return DeviceNotFoundError(
                f"{self}: no such port; plug its adapter in, or name another: {self._by_id} offers {offers}"
            )
        if error.errno in DENIED:
            return DeviceAccessError(
                f"{self}: may not be opened by this user; add it to the group dialout and log in again"
            )
        if error.errno in BUSY:
            return DeviceAccessError(f"{self}: another program holds the port; stop it")
        if error.errno is None or error.errno == errno.EISDIR:
            return DeviceNotFoundError(f"{self}: is not a serial port; give one, preferably under {self._by_id}")
        return TransferError(f"{self}: the port does not open ({error}); plug its adapter out and in again")
