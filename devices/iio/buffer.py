"""A buffer of a Linux IIO device: its scan elements, its switch in sysfs, and the bytes that come from `/dev/iio:deviceN`."""

import errno
import os
import select
from contextlib import suppress
from pathlib import Path

from devices.errors import GONE_ERRNOS, DeviceAccessError, DeviceError, DeviceNotFoundError, TransferError
from devices.iio.sysfs import IioAttributes, ScanLayout, ScanType

ACCELERATION = ("in_accel_x", "in_accel_y", "in_accel_z")
ANGULAR_RATE = ("in_anglvel_x", "in_anglvel_y", "in_anglvel_z")
TIMESTAMP = "in_timestamp"
BUFFER_S = 2.0
"""Samples of this time fit into the kernel's buffer while the host is late. Basis: a choice; longer than any write stops a
thread, and some kilobytes."""


class IioBuffer:
    """The buffer of one device, switched on while it is open."""

    def __init__(self, device: IioAttributes, character_device: Path, trigger: str | None = None) -> None:
        """`trigger`: name of the trigger that starts each scan; None: as it is set, or the device needs none."""
        self._device, self._path, self._trigger = device, character_device, trigger
        self._file: int | None = None
        self._rest = b""
        self.layout = ScanLayout({TIMESTAMP: (0, ScanType.parse("le:s64/64>>0"))})
        self.has_gyro = False

    def open(self, odr_hz: float, block_samples: int) -> None:
        """Enable what is wanted, switch the buffer on and open it. Raises `DeviceError`."""
        self.close()
        device = self._device
        device.write("buffer/enable", 0)
        self.layout = self._enable_elements()
        if self._trigger is not None:
            device.write("trigger/current_trigger", self._trigger)
        device.write("buffer/length", max(4 * block_samples, round(BUFFER_S * odr_hz)))
        if device.has("buffer/watermark"):
            device.write("buffer/watermark", block_samples)
        try:
            device.write("buffer/enable", 1)
        except DeviceError as error:
            raise DeviceError(
                f"{error}; a device without an interrupt needs device.trigger, such as an hrtimer"
            ) from error
        self._rest = b""
        try:
            self._file = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise _open_error(self._path, error) from error

    def read(self, timeout_s: float) -> bytes:
        """Return the whole scans that are there, waiting for the first; a part of one is kept for the next call.

        Raises `TransferError` where the device has gone.
        """
        if self._file is None:
            raise TransferError(f"{self._path}: the buffer is not open; open it first")
        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        if not poll.poll(max(0.0, timeout_s) * 1000):
            return b""
        size = self.layout.scan_bytes
        try:
            data = os.read(self._file, max(4096 // size, 1) * size)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise TransferError(f"{self._path}: {error.strerror} (errno {error.errno}); {_advice(error)}") from error
        if not data:
            raise TransferError(f"{self._path}: ended; {GONE_ADVICE}")
        data = self._rest + data
        whole = len(data) // size * size
        self._rest = data[whole:]
        return data[:whole]

    def close(self) -> None:
        """Switch the buffer off and release it; never raises."""
        if self._file is not None:
            with suppress(OSError):
                os.close(self._file)
            self._file = None
            with suppress(DeviceError):
                self._device.write("buffer/enable", 0)

    def _enable_elements(self) -> ScanLayout:
        """Enable acceleration, angular rate and timestamp as far as there are such, and no other element."""
        device = self._device
        self.has_gyro = all(device.has(f"scan_elements/{name}_en") for name in ANGULAR_RATE)
        wanted = [*ACCELERATION, *(ANGULAR_RATE if self.has_gyro else ())]
        if device.has(f"scan_elements/{TIMESTAMP}_en"):
            wanted.append(TIMESTAMP)
        if missing := [name for name in ACCELERATION if not device.has(f"scan_elements/{name}_en")]:
            raise DeviceError(f"{device.folder}: has no scan element {missing[0]}; set device.mode = 'polled'")
        for path in sorted((device.folder / "scan_elements").glob("*_en")):
            device.write(f"scan_elements/{path.name}", int(path.name.removesuffix("_en") in wanted))
        elements = {}
        for path in sorted((device.folder / "scan_elements").glob("*_en")):
            if device.read(f"scan_elements/{path.name}") == "1":  # a driver may enable more than was asked for
                elements[path.name.removesuffix("_en")] = self._element(path.name.removesuffix("_en"))
        if missing := [name for name in wanted if name not in elements]:
            raise DeviceError(
                f"{device.folder}: scan element {missing[0]} cannot be enabled; set device.mode = 'polled'"
            )
        try:
            return ScanLayout(elements)
        except ValueError as error:
            raise DeviceError(f"{device.folder}/scan_elements: {error}") from error

    def _element(self, name: str) -> tuple[int, ScanType]:
        type_ = self._device.read_type(f"scan_elements/{name}_type")
        return int(self._device.read_number(f"scan_elements/{name}_index")), type_


GONE_ADVICE = "the sensor has gone, or its driver was unloaded"


def _advice(error: OSError) -> str:
    return GONE_ADVICE if error.errno in GONE_ERRNOS else "check bus, cable and the kernel's log"


def _open_error(path: Path, error: OSError) -> DeviceError:
    if error.errno in GONE_ERRNOS:
        return DeviceNotFoundError(f"{path}: no such device; {GONE_ADVICE}")
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceAccessError(f"{path}: may not be opened by this user; add it to the group of its udev rule")
    if error.errno == errno.EBUSY:
        return DeviceAccessError(f"{path}: another program reads the buffer; stop it")
    return TransferError(f"{path}: does not open: {error.strerror} (errno {error.errno})")
