"""What is known of a gateway now: the one place where a bridge decides whether a value is valid. Pure; time is an argument.

Its state is a word that programmable controllers get as a number.
"""

import math
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

from gateway.gateway_state import GatewayState
from gateway.messages import SCHEMA_VERSION, Level

LONGEST_AGE_MS = 32_766
"""Largest age that is stated; an older reading states this one. Definition: the largest that the register of the age carries."""


class PlantState(StrEnum):
    """Only `FINE` means that the measured values are known now."""

    NO_DATA = "no data"
    FINE = "fine"
    NOT_KNOWN = "not known"
    UNCALIBRATED = "uncalibrated"
    SUSPENDED = "suspended"
    SENSOR_GONE = "sensor gone"
    STALE = "stale"
    GATEWAY_GONE = "gateway gone"
    LINK_GONE = "link gone"
    SIMULATED = "simulated"
    REPLAY = "replay"
    DUPLICATE = "duplicate"
    BRIDGE_GONE = "bridge gone"
    NOT_AUTHENTICATED = "not authenticated"


@dataclass(frozen=True, slots=True)
class Code:
    """A word with the number that stands for it, which never changes, and its meaning."""

    number: int
    meaning: str


STATE_CODES: dict[str, Code] = {
    PlantState.NO_DATA: Code(0, "nothing has come from the gateway yet"),
    PlantState.FINE: Code(1, "the values are known now"),
    PlantState.NOT_KNOWN: Code(2, "the gateway does not know the angle at the moment"),
    PlantState.UNCALIBRATED: Code(3, "the sensor has no calibration"),
    PlantState.SUSPENDED: Code(4, "the housing is off the rope, for a recalibration"),
    PlantState.SENSOR_GONE: Code(5, "the gateway gets no samples from its sensor"),
    PlantState.STALE: Code(6, "the gateway answers, and no new reading has come for a second"),
    PlantState.GATEWAY_GONE: Code(7, "the gateway has stopped, or hangs"),
    PlantState.LINK_GONE: Code(8, "the bridge has no link to the gateway or its router, or its certificate is refused"),
    PlantState.SIMULATED: Code(9, "the gateway simulates a crane"),
    PlantState.REPLAY: Code(10, "a recording is replayed"),
    PlantState.DUPLICATE: Code(11, "two gateways use this name at the same time"),
    PlantState.BRIDGE_GONE: Code(12, "the bridge has ended or hangs; MQTT alone can say this"),
    PlantState.NOT_AUTHENTICATED: Code(13, "what comes under the gateway's name is not signed with its key"),
}
"""Definition: the numbers that stand for these words."""
LEVEL_CODES: dict[str, Code] = {
    "unknown": Code(0, "no statement is possible, which does not mean safe"),
    "normal": Code(1, "no alert is active"),
    "warn": Code(2, "a warning is active"),
    "trip": Code(3, "a limit is reached"),
}
"""Definition: the numbers that stand for these words."""
SOURCE_CODES: dict[str, Code] = {
    "unknown": Code(0, "not known yet"),
    "sensor": Code(1, "a sensor takes the samples"),
    "simulated": Code(2, "a simulated crane"),
    "replay": Code(3, "a recording"),
}
"""Definition: the numbers that stand for these words."""
STATED = {state: PlantState(state) for state in GatewayState}
"""The words of the bus, which this list extends."""
UNHEARD = (
    PlantState.NO_DATA,
    PlantState.GATEWAY_GONE,
    PlantState.LINK_GONE,
    PlantState.NOT_AUTHENTICATED,
    PlantState.BRIDGE_GONE,
)
"""States in which nothing that the gateway has said holds any longer."""
WITHOUT_SENSOR: dict[str, PlantState] = {"simulated": PlantState.SIMULATED, "replay": PlantState.REPLAY}
"""By the kind of the device."""


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
