"""The attributes of a Linux IIO device in sysfs: finding it by its name or label, its scale, rate and temperature.

Kernel documentation: ABI/testing/sysfs-bus-iio. The kernel gives acceleration in m/s², angular rate in rad/s, temperature in
thousandths of a degree, each as (raw + offset) x scale.

Scans of a buffer, section "Buffers" of "Industrial I/O": `_type` is `[be|le]:[s|u]bits/storagebits[Xrepeat][>>shift]`, elements
are in the order of `_index`, each aligned to its own size, and a scan to that of its largest element.
"""

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.errors import (
    ConfigurationReadBackError,
    DeviceAccessError,
    DeviceError,
    DeviceNotFoundError,
    TransferError,
)
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2

TEMPERATURE_PERIOD_NS = 1_000_000_000
"""Period of the temperature. Basis: a choice; a housing warms up within minutes."""
DEVICES = Path("sys/bus/iio/devices")
EXACT_UNITS_PER_G = {
    "adxl345": (256.0,),
    "adxl355": (256000.0,),
    "adxl359": (51200.0,),
    "mpu6050": (16384.0, 8192.0, 4096.0, 2048.0),
    "mpu6500": (16384.0, 8192.0, 4096.0, 2048.0),
    "mpu9250": (16384.0, 8192.0, 4096.0, 2048.0),
    "mpu9255": (16384.0, 8192.0, 4096.0, 2048.0),
}
"""Counts per g of parts whose driver rounds the scale (adxl355_core.c: 3.9 instead of 3.90625 ug, 0.16 %; adxl345_core.c: 0.0383,
0.02 %; inv_mpu_core.c: 0.000598, 0.09 %). Basis: data sheets."""
SCALE_ROUNDING = 5e-3
"""Relative difference within which a scale is taken for a rounded one. Basis: a choice; three times the worst rounding known
(0.16 %), far below the step to the next range."""
READ_BACK_TOLERANCE = 1e-3
"""Relative, of a rate or a scale that is read back. Basis: a choice; above the rounding of six digits, below two rates."""
RANGE_SHARE = 0.99
"""Share of a range that a scale must reach. Basis: a choice; a full scale is a step short of its range."""
TYPE = re.compile(
    r"(?P<order>le|be):(?P<sign>[su])(?P<bits>\d+)/(?P<storage>\d+)(?:X(?P<repeat>\d+))?(?:>>(?P<shift>\d+))?"
)
STORAGE_BITS = (8, 16, 32, 64)
"""Definition: sizes of an element (Linux, IIO)."""


class IioAttributes:
    """The folder of one device."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def number(self) -> str:
        """The folder's name, such as `iio:device0`; it may change at the next start."""
        return self.folder.name

    def has(self, attribute: str) -> bool:
        """Return whether the device has an attribute."""
        return (self.folder / attribute).exists()

    def read(self, attribute: str) -> str:
        """Return an attribute. Raises `TransferError` for a read that fails, `DeviceNotFoundError` where it is missing."""
        try:
            return (self.folder / attribute).read_text().strip()
        except FileNotFoundError as error:
            raise DeviceNotFoundError(
                f"{self.folder / attribute}: no such attribute; is the sensor still there?"
            ) from error
        except OSError as error:
            raise TransferError(f"{self.folder / attribute}: {error.strerror} (errno {error.errno})") from error

    def read_number(self, attribute: str) -> float:
        """Return an attribute that is a number. Raises as `read`, and `TransferError` where it is none."""
        text = self.read(attribute)
        try:
            return float(text)
        except ValueError as error:
            raise TransferError(f"{self.folder / attribute}: {text!r} is no number") from error

    def read_type(self, attribute: str) -> "ScanType":
        """Return an attribute that is the type of an element. Raises as `read`, and `DeviceError` where it is none."""
        text = self.read(attribute)
        try:
            return ScanType.parse(text)
        except ValueError as error:
            raise DeviceError(f"{self.folder / attribute}: {error}") from error

    def available(self, attribute: str) -> list[float]:
        """Return the numbers to which an attribute can be set, none where the device does not state them. Raises as `read`."""
        name = f"{attribute}_available"
        return [float(text) for text in self.read(name).split()] if self.has(name) else []

    @property
    def rate_attribute(self) -> str:
        """The attribute of the sample rate: that of the accelerometer, or of the whole device."""
        own = "in_accel_sampling_frequency"
        return own if self.has(own) else "sampling_frequency"

    def write(self, attribute: str, value: object) -> None:
        """Write an attribute. Raises `DeviceAccessError`, `DeviceNotFoundError`, `DeviceError`."""
        path = self.folder / attribute
        try:
            path.write_text(f"{value}")
        except FileNotFoundError as error:
            raise DeviceNotFoundError(f"{path}: no such attribute; is the sensor still there?") from error
        except PermissionError as error:
            raise DeviceAccessError(
                f"{path}: may not be written by this user; add a udev rule for its group"
            ) from error
        except OSError as error:
            raise DeviceError(f"{path}: {value} is refused: {error.strerror} (errno {error.errno})") from error

    def set_number(self, attribute: str, value: float, what: str) -> float:
        """Write a number unless it is already set, and return the one that is read back.

        Raises `ConfigurationReadBackError` where it differs by more than 0.1 %, with what is available.
        """
        if not _close(self.read_number(attribute), value):
            self.write(attribute, f"{value:.9g}")
        found = self.read_number(attribute)
        if not _close(found, value):
            available = self.folder / f"{attribute}_available"
            others = f"; available are {available.read_text().strip()}" if available.exists() else ""
            raise ConfigurationReadBackError(f"{self.folder / attribute}: reads {found:g}, {what} is {value:g}{others}")
        return found

    def temperature_c(self) -> float | None:
        """Return the temperature; None where the part has none, or it cannot be read at the moment."""
        with suppress(TransferError, DeviceNotFoundError):
            if self.has("in_temp_input"):
                return self.read_number("in_temp_input") / 1000
            if self.has("in_temp_raw"):
                offset = self.read_number("in_temp_offset") if self.has("in_temp_offset") else 0.0
                return (self.read_number("in_temp_raw") + offset) * self.read_number("in_temp_scale") / 1000
        return None

    def scale(self, kind: str, axis: str) -> tuple[str, float]:
        """Return the attribute with the scale of an axis, its own or that of all, and its value. Raises `DeviceError`."""
        attribute = next((name for name in (f"in_{kind}_{axis}_scale", f"in_{kind}_scale") if self.has(name)), None)
        if attribute is None:
            raise DeviceError(f"{self.folder}: has no in_{kind}_scale; it cannot be used as an accelerometer")
        scale = self.read_number(attribute)
        if not scale > 0:
            raise DeviceError(f"{self.folder / attribute}: {scale:g} is no scale")
        return attribute, scale

    def set_range(self, range_g: float, largest_count: int) -> None:
        """Set the finest scale that reaches a range; `largest_count`: the largest reading. Raises `DeviceError`."""
        attribute, scale = self.scale("accel", "x")
        reach_g_per_scale = largest_count / STANDARD_GRAVITY_M_S2
        scales = self.available(attribute) or [scale]
        fitting = [each for each in scales if each * reach_g_per_scale >= RANGE_SHARE * range_g]
        if not fitting:
            reached = ", ".join(f"{each * reach_g_per_scale:.3g}" for each in scales)
            raise DeviceError(f"{self.folder}: has no range of {range_g:g} g; it has {reached}")
        self.set_number(attribute, min(fitting), "the scale of device.range_g")

    def units_per_g(self) -> float:
        """Return the counts per g, without the rounding of known drivers. Raises `DeviceError` where the axes differ."""
        scales = {self.scale("accel", axis)[1] for axis in "xyz"}
        if len(scales) > 1:
            raise DeviceError(f"{self.folder}: the axes have different scales {sorted(scales)}; set them to one")
        reported = STANDARD_GRAVITY_M_S2 / scales.pop()
        exact = EXACT_UNITS_PER_G.get(self.read("name"), ())
        return next((known for known in exact if abs(reported / known - 1) < SCALE_ROUNDING), reported)


def find_iio_device(root: Path, name: str) -> IioAttributes:
    """Return the device with a name or label. Raises `DeviceNotFoundError`, and `DeviceError` where two have it."""
    folders = sorted((root / DEVICES).glob("iio:device*"))
    known = {folder: _names(IioAttributes(folder)) for folder in folders}
    found = [folder for folder, names in known.items() if name in names]
    if not found:
        others = ", ".join(sorted({each for names in known.values() for each in names})) or "none"
        raise DeviceNotFoundError(
            f"no IIO device has the name or label {name!r}; there are {others}; is its driver loaded?"
        )
    if len(found) > 1:
        raise DeviceError(f"{len(found)} IIO devices have the name {name!r}; give the label of one in device.name")
    return IioAttributes(found[0])


def _names(device: IioAttributes) -> list[str]:
    found = []
    for attribute in ("name", "label"):
        with suppress(TransferError, DeviceNotFoundError):
            found.append(device.read(attribute))
    return found


def _close(value: float, wanted: float) -> bool:
    return abs(value - wanted) <= READ_BACK_TOLERANCE * abs(wanted)


@dataclass(frozen=True, slots=True)
class ScanType:
    """The format of one element of a scan."""

    is_big_endian: bool
    is_signed: bool
    bits: int
    storage_bits: int
    shift: int

    @classmethod
    def parse(cls, text: str) -> "ScanType":
        """Return the type of a text such as `be:s20/32>>4`. Raises `ValueError`."""
        found = TYPE.fullmatch(text.strip())
        if found is None:
            raise ValueError(f"{text.strip()!r} is no scan type such as 'le:s16/16>>0'")
        bits, storage_bits, shift = int(found["bits"]), int(found["storage"]), int(found["shift"] or 0)
        if storage_bits not in STORAGE_BITS or not 0 < bits <= storage_bits - shift or int(found["repeat"] or 1) != 1:
            raise ValueError(f"scan type {text.strip()!r} is not one number within 8, 16, 32 or 64 bits")
        return cls(found["order"] == "be", found["sign"] == "s", bits, storage_bits, shift)

    @property
    def bytes(self) -> int:
        """Size in the scan."""
        return self.storage_bits // 8

    @property
    def limits(self) -> tuple[int, int]:
        """Lowest and highest number."""
        if self.is_signed:
            return -(1 << (self.bits - 1)), (1 << (self.bits - 1)) - 1
        return 0, (1 << self.bits) - 1

    def decode(self, words: NDArray[np.generic]) -> NDArray[np.int64]:
        """Return the numbers in unsigned words of the storage's size; bits outside the number may have any value."""
        unused = 64 - self.bits
        left_justified = words.astype(np.uint64) << np.uint64(unused - self.shift)
        if self.is_signed:
            return np.asarray(left_justified.view(np.int64) >> np.int64(unused), dtype=np.int64)
        return np.asarray((left_justified >> np.uint64(unused)).astype(np.int64), dtype=np.int64)


class ScanLayout:
    """The elements of a scan, by name."""

    def __init__(self, elements: Mapping[str, tuple[int, ScanType]]) -> None:
        """`elements`: index and type of every enabled element. Raises `ValueError` where two have one index."""
        if len({index for index, _ in elements.values()}) != len(elements):
            raise ValueError("two scan elements have the same index")
        self.types = {name: type_ for name, (_, type_) in sorted(elements.items(), key=lambda item: item[1][0])}
        offset, offsets = 0, []
        for type_ in self.types.values():
            offset = _aligned(offset, type_.bytes)
            offsets.append(offset)
            offset += type_.bytes
        self.scan_bytes = _aligned(offset, max(type_.bytes for type_ in self.types.values()))
        self._dtype = np.dtype(
            {
                "names": list(self.types),
                "formats": [f"{'>' if t.is_big_endian else '<'}u{t.bytes}" for t in self.types.values()],
                "offsets": offsets,
                "itemsize": self.scan_bytes,
            }
        )

    def decode(self, scans: bytes) -> dict[str, NDArray[np.int64]]:
        """Return the numbers of each element of whole scans, shape (n,)."""
        table = np.frombuffer(scans, dtype=self._dtype)
        return {name: type_.decode(table[name]) for name, type_ in self.types.items()}


def _aligned(offset: int, size: int) -> int:
    return -(-offset // size) * size
