"""The attributes of a Linux IIO device in sysfs: finding it by its name or label, its scale, rate and temperature.

Kernel documentation: ABI/testing/sysfs-bus-iio. The kernel gives acceleration in m/s², angular rate in rad/s, temperature in
thousandths of a degree, each as (raw + offset) x scale.
"""

from contextlib import suppress
from pathlib import Path

from devices.errors import (
    ConfigurationReadBackError,
    DeviceAccessError,
    DeviceError,
    DeviceNotFoundError,
    TransferError,
)
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2

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
        available = f"{attribute}_available"
        scales = [float(text) for text in self.read(available).split()] if self.has(available) else [scale]
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
