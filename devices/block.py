"""What a device hands on: blocks of samples, and what is known of the part that made them."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

RawUnit = Literal["counts", "g"]


@dataclass(frozen=True, slots=True)
class SampleBlock:
    """Consecutive samples of one burst, oldest first, in the sensor's own axes and unit."""

    time_ns: NDArray[np.int64]
    """Sample times, shape (n,), strictly increasing: gateway time, see `devices.clock`."""
    raw: NDArray[np.int32] | NDArray[np.float64]
    """Readings as the part gives them, shape (n, 3), in `DeviceInfo.unit`; int32 for counts, float64 for g."""
    temperature_c: float | None = None
    """The part's own temperature with this block, where it has one."""
    lost: int = 0
    """Samples known to be missing just before this block (overrun, sequence gap, radio loss)."""
    invalid: int = 0
    """Entries that came and could not be used (bad checksum, NaN, repeated or backward time)."""

    def __len__(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Identity and nominal figures of an opened device."""

    kind: str
    device_id: str
    """Identity that a calibration record is found by; stable over restarts, another for another part."""
    unit: RawUnit
    odr_hz: float
    """Nominal output data rate."""
    units_per_g: float
    """Nominal sensitivity: counts per g, or 1 where `raw` is already in g."""
    full_scale_g: float | None = None
    """A reading at or beyond this is clipped; None where it is not known."""
    noise_g: float | None = None
    """Typical noise, 1 sigma per sample and axis at this rate; None: estimate it from the data."""
    zero_g_offset_g: float | None = None
    """Datasheet limit of the zero-g offset: the uncertainty of an uncalibrated axis."""
    bandwidth_hz: float | None = None
    """-3 dB of the low-pass inside the part; None: there is none below half the rate, or it is not known."""
    zero_g_offset_g_per_k: float | None = None
    """Datasheet limit of the zero-g offset's change with temperature, either way; None: not known."""
    scale_factor_per_k: float | None = None
    """Datasheet figure of the scale factor's relative change with temperature, either way; None: not known."""
    factory_calibration: dict[str, Any] | None = None
    """A calibration record that comes with the part (see `gateway.calibration.record`)."""
    calibrated_source: bool = False
    """The readings are specific force in the housing frame already (a recording in g)."""
    can_wait: bool = False
    """The source waits for its reader (a recording): blocks are never dropped because somebody is slow."""
    details: dict[str, str] = field(default_factory=dict)
    """Other facts worth showing: revision, bus, port, firmware."""
