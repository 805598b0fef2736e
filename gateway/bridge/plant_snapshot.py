"""What is known of a gateway now: the one place where a bridge decides whether a value is valid. Pure; time is an argument."""

import math
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime

from gateway.bridge.plant_state import PlantState
from gateway.messages import SCHEMA_VERSION, Level

LONGEST_AGE_MS = 32_766
"""Largest age that is stated; an older reading states this one. Definition: the largest that the register of the age carries."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSnapshot:
    """What is known; None: not known. A measured value is never one of the past."""

    state: PlantState
    source: str = "unknown"
    heartbeat: int = 0
    """Rises with each valid reading that is taken, modulo 65536: it stands still while nothing is known."""
    age_s: float | None = None
    """Since the newest reading arrived at the bridge; None: none has."""
    sample_time_ns: int | None = None
    """UTC of the newest sample, by the gateway's clock."""
    level: Level = "unknown"
    active_alerts: int | None = None
    alert_number: int | None = None
    boot_id: str | None = None
    angle_deg: float | None = None
    angle_u95_deg: float | None = None
    phi_max_deg: float | None = None
    phi_max_u95_deg: float | None = None
    peak_deg: float | None = None
    peak_u95_deg: float | None = None
    time_to_peak_s: float | None = None
    calibration_age_days: float | None = None
    battery_percent: float | None = None
    battery_v: float | None = None

    @property
    def schema_version(self) -> int:
        """Version of the values: raised when one is removed, renamed or changes its meaning."""
        return SCHEMA_VERSION

    @property
    def age_ms(self) -> int | None:
        """The age in whole milliseconds, at most `LONGEST_AGE_MS`."""
        return None if self.age_s is None else min(math.floor(1e3 * self.age_s), LONGEST_AGE_MS)

    @property
    def boot(self) -> int | None:
        """A number that differs from start to start of the gateway: the CRC-32 of its boot id."""
        return None if self.boot_id is None else zlib.crc32(self.boot_id.encode())

    @property
    def sample_time(self) -> datetime | None:
        """UTC of the newest sample; None also where the gateway's clock is out of every range."""
        try:
            return None if self.sample_time_ns is None else datetime.fromtimestamp(self.sample_time_ns / 1e9, UTC)
        except (OverflowError, ValueError, OSError):
            return None


BRIDGE_GONE = PlantSnapshot(state=PlantState.BRIDGE_GONE)
