"""The data that a device delivers: blocks of samples, and a description of the sensor."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

RawUnit = Literal["counts", "g"]


@dataclass(frozen=True, slots=True)
class RadioStatus:
    """What a wireless sensor reports about its battery and its radio link; None: not reported."""

    battery_v: float | None = None
    battery_percent: float | None = None
    battery_low: bool | None = None
    """The battery is below the limit of the part, or the part says so."""
    signal_dbm: float | None = None
    """Received power at the base."""


@dataclass(frozen=True, slots=True)
class SampleBlock:
    """Consecutive samples of one burst, oldest first, in the sensor's own axes and unit."""

    time_ns: NDArray[np.int64]
    """Sample times in gateway time, shape (n,), strictly increasing; see `devices.clock`."""
    raw: NDArray[np.int32] | NDArray[np.float64]
    """Readings, shape (n, 3), in `DeviceInfo.unit`; int32 for counts, float64 for g."""
    temperature_c: float | None = None
    """Temperature of the sensor during this block; None if it does not report one."""
    lost: int = 0
    """Samples known to be missing immediately before this block (overrun, sequence gap, radio loss)."""
    invalid: int = 0
    """Samples that arrived and could not be used (bad checksum, NaN, repeated or backward time)."""
    gyro_counts: NDArray[np.int32] | None = None
    """Angular rates in the sensor's own axes, shape (n, 3), see `DeviceInfo.gyro_rad_s_per_count`; None without a gyroscope."""
    radio: RadioStatus | None = None
    """What a wireless sensor reported with this block; None: nothing."""
    saturated: NDArray[np.bool_] | None = None
    """Samples with an axis at the end of what the part can read, shape (n,): the true value may be larger.

    None: the device does not mark them; `DeviceInfo.full_scale_g` decides.
    """

    def __len__(self) -> int:
        return len(self.time_ns)

    def select(self, kept: slice | NDArray[np.bool_]) -> "SampleBlock":
        """Return the block with some of its samples; temperature and counts stay."""
        return replace(
            self,
            time_ns=self.time_ns[kept],
            raw=self.raw[kept],
            gyro_counts=None if self.gyro_counts is None else self.gyro_counts[kept],
            saturated=None if self.saturated is None else self.saturated[kept],
        )


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Identity and nominal properties of an opened device."""

    kind: str
    device_id: str
    """Identity by which a calibration record is found: the same after a restart, different for another part."""
    unit: RawUnit
    odr_hz: float
    """Nominal output data rate."""
    units_per_g: float
    """Nominal sensitivity: counts per g, or 1 where `raw` is in g."""
    full_scale_g: float | None = None
    """A reading at or beyond this is clipped where the device does not mark saturated samples; None: not known."""
    noise_g: float | None = None
    """Typical noise, 1 sigma per sample and axis at this rate; None: to be estimated from the data."""
    zero_g_offset_g: float | None = None
    """Limit of the zero-g offset by the data sheet: the uncertainty of an uncalibrated axis."""
    gyro_rad_s_per_count: float | None = None
    """Angular rate of one count; None without a gyroscope."""
    gyro_noise_rad_s: float | None = None
    """Typical noise of the angular rates, 1 sigma per sample and axis; None: to be estimated from the data."""
    gyro_bias_rad_s: float | None = None
    """Limit of the angular rate that is read at rest, by the data sheet; None: not known."""
    bandwidth_hz: float | None = None
    """-3 dB frequency of the part's own low-pass filter; None: not known, or above half the rate."""
    zero_g_offset_g_per_k: float | None = None
    """Limit of the change of the zero-g offset with temperature by the data sheet; None: not known."""
    scale_factor_per_k: float | None = None
    """Relative change of the scale factor with temperature by the data sheet; None: not known."""
    factory_calibration: dict[str, Any] | None = None
    """A calibration record that comes with the part (see `gateway.calibration.record`)."""
    calibrated_source: bool = False
    """The readings are calibrated specific force in the housing frame (a recording in g)."""
    can_wait: bool = False
    """The source waits for its reader (a recording), so blocks are never dropped."""
    details: dict[str, str] = field(default_factory=dict)
    """Further properties for display: revision, bus, port, firmware."""
