"""The sections of the configuration: keys, units, defaults and limits."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import AfterValidator, Field, field_validator, model_validator

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, normal_gravity_m_s2
from gateway.configuration.bus_section import BusSection
from gateway.configuration.device_sections import AnyDevice, SimulatedDevice
from gateway.configuration.relay_section import AnyRelay, NoRelay
from gateway.configuration.section import KEY_PATTERN, Address, Section, host_and_port, one_of
from gateway.languages import LANGUAGES
from gateway.topics import DEMO_SITE, KEY_PREFIX

MAX_CUTOFF_SHARE = 0.4
"""Largest cut-off frequency of the low-pass, relative to the sample rate. Basis: a choice; below half the sample rate (Nyquist),
where the bilinear transform ends."""
SIMULATED_RHO = 0.75
"""Position of a simulated housing without a configured position, as a share of the rope's length. Basis: a choice; between the
middle of the rope and the hook."""


def _check_web_address(text: str) -> str:
    if re.fullmatch(r"https?://[^\s\"'<>]+", text) is None:
        raise ValueError("an address has the form https://name/path")
    return text


WebAddress = Annotated[str, Field(max_length=200), AfterValidator(_check_web_address)]


class GatewaySection(Section):
    """The identity of the gateway: the key of its messages and the folder of its data."""

    site: str = Field(DEMO_SITE, pattern=KEY_PATTERN, description="first part of the bus key")
    crane: str = Field("crane-1", pattern=KEY_PATTERN, description="second part of the bus key")
    sensor: str = Field("hook-1", pattern=KEY_PATTERN, description="third part of the bus key")
    data_dir: Path = Field(Path("plumbline-data"), description="folder of recordings and calibration records")

    @field_validator("data_dir")
    @classmethod
    def _check_path(cls, path: Path) -> Path:
        if "\0" in str(path):
            raise ValueError("data_dir: a path cannot contain a NUL character")
        return path

    demonstration: bool = Field(
        False, description="allows the service to run without a sensor: a simulated crane or a recording"
    )

    @property
    def key(self) -> str:
        """Prefix of every key on the bus."""
        return f"{KEY_PREFIX}{self.site}/{self.crane}/{self.sensor}"


class RopeSection(Section):
    """The rope as configured; the measured period takes precedence."""

    length_m: float = Field(12.0, gt=0, le=500, description="pivot to the load's centre")


ALIGNED_MOUNT_U_DEG = 0.06
"""Standard uncertainty of the angle between the housing's z axis and the rope after zeroing in place. Basis: a little more than
that of the rope as a plumb line, `zeroing.PLUMB_U_DEG`."""


MAX_ABOVE_LOAD_SHARE = 1.2
"""Largest distance above the load over the rope's length. Basis: the length is a belief that may be a fifth too short."""


MountedOn = Literal["rope", "converging_ropes", "spreader"]
"""What carries the housing: a rope that hangs alone or beside parallel ones, one of several ropes that converge, or the spreader
under them, which does not turn with its ropes."""
PLACED_FROM_LOAD: frozenset[MountedOn] = frozenset({"converging_ropes", "spreader"})
"""Where a housing has its place from the load alone: the distance from the pivot along a rope says nothing there."""


class HousingPlace(Section):
    """Position of the housing on the rope, by one of the two keys, and what carries it."""

    position_m: float | None = Field(
        None,
        ge=0,
        description="from the pivot, along the rope; whether a hoist moves it, the readings must tell, at half as much computing "
        "again: give above_load_m where it does",
    )
    above_load_m: float | None = Field(None, ge=0, description="distance to the load's centre; constant while hoisting")
    mounted_on: MountedOn | None = Field(
        None,
        description="rope, converging_ropes (one of several that come together above a spreader) or spreader; "
        "not stated: found from the readings near the load, a rope elsewhere",
    )

    @model_validator(mode="after")
    def _check_single_position(self) -> Self:
        if self.position_m is not None and self.above_load_m is not None:
            raise ValueError("position_m and above_load_m both state the position of the housing; keep one")
        if self.mounted_on in PLACED_FROM_LOAD and self.above_load_m is None:
            raise ValueError(f"mounted_on = {self.mounted_on} wants above_load_m, the distance to the load's centre")
        return self


class HousingSection(HousingPlace):
    """Position and mount of the housing."""

    mount_u_deg: float = Field(
        ALIGNED_MOUNT_U_DEG,
        ge=0,
        le=10,
        description="standard uncertainty of the angle between the housing's z axis and the rope: 0.06 after zeroing "
        "in place, 0.57 if clamped by eye without zeroing",
    )


class SiteSection(Section):
    """Gravity, given directly or by latitude and altitude."""

    gravity_m_s2: float | None = Field(
        None, gt=9.7, lt=9.9, description="local gravity; default: by latitude_deg, or the standard 9.80665"
    )
    latitude_deg: float | None = Field(None, ge=-90, le=90, description="latitude of the site, for its gravity")
    altitude_m: float = Field(0.0, ge=-500, le=9000, description="height above sea level, for the gravity")

    @property
    def is_known(self) -> bool:
        """Whether its gravity follows from what is stated."""
        return self.gravity_m_s2 is not None or self.latitude_deg is not None

    @property
    def local_gravity_m_s2(self) -> float:
        """Local gravity: as given, or by WGS 84 (Somigliana) with the free-air correction."""
        if self.gravity_m_s2 is not None:
            return self.gravity_m_s2
        if self.latitude_deg is None:
            return STANDARD_GRAVITY_M_S2
        return normal_gravity_m_s2(self.latitude_deg, self.altitude_m)


class FilterSection(Section):
    """The Butterworth low-pass filter for the static tilt and the published formulas."""

    cutoff_hz: float = Field(1.0, gt=0, le=100, description="-3 dB frequency")
    order: int = Field(2, ge=1, le=8, description="order of the filter")


class AlertsSection(Section):
    """Limits of the alerts, compared with the angle plus 0.75 standard uncertainties, less for a later peak."""

    warn_deg: float = Field(4.0, gt=0, lt=90, description="warning level of the swing")
    trip_deg: float = Field(6.0, gt=0, lt=90, description="trip level of the swing")
    clear_deg: float = Field(3.0, gt=0, lt=90, description="an alert clears below this level, after hold_s")
    hold_s: float = Field(
        3.0,
        ge=0,
        le=600,
        description="time below clear_deg after which an alert clears, or below 90 % of trip_deg until a trip steps down; an "
        "unknown angle starts it anew",
    )
    lean_trip_deg: float = Field(3.0, gt=0, lt=90, description="trip level of the lean, which a side pull causes")
    stale_s: float = Field(1.0, ge=0.2, le=60, description="without a sample for this long the reading is stale")

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.clear_deg <= self.warn_deg <= self.trip_deg:
            raise ValueError(
                f"clear_deg {self.clear_deg:g} <= warn_deg {self.warn_deg:g} <= trip_deg {self.trip_deg:g} must hold"
            )
        return self


MAX_EVENT_S = 86_400.0
"""Definition: a day."""
MAX_QUOTA_MB = 1e9
"""Basis: a choice; a petabyte, larger than any disk."""


class RecorderSection(Section):
    """The flight recorder."""

    segment_s: float = Field(600.0, ge=1, le=86400, description="length of a file")
    quota_mb: float = Field(
        16000.0, gt=0, le=MAX_QUOTA_MB, description="total size beyond which the oldest closed files are deleted"
    )
    keep_events_days: float = Field(
        7.0,
        ge=0,
        le=3650,
        description="the time around an alert, recalibration, fault or mark that is younger is not deleted by the quota",
    )
    fsync_s: float = Field(1.0, gt=0, le=60, description="interval of syncs: the most that a power failure costs")
    pre_event_s: float = Field(
        60.0,
        ge=0,
        le=MAX_EVENT_S,
        description="time before an alert, recalibration, fault or mark that is deleted last",
    )
    post_event_s: float = Field(
        120.0, ge=0, le=MAX_EVENT_S, description="time after such an event that is deleted last"
    )
    key: Path | None = Field(
        None,
        description="Ed25519 key in PEM that signs the recordings; default: data_dir/signing-key.pem, made at first start",
    )
    time_stamp_authority: WebAddress | None = Field(
        None,
        description="address of a time stamp authority (RFC 3161) that stamps the newest signed statement; default: none",
    )
    time_stamp_every_s: float = Field(3600.0, ge=1, le=604_800, description="least time between two time stamps")


DirectionName = Annotated[str, Field(min_length=1, max_length=14, pattern=r"^[^\x00-\x1f\x7f]+$")]


class DirectionsSection(Section):
    """The crane's own words for the directions of the housing's axes, as the operator's page displays them."""

    plus_x: DirectionName = "+x"
    minus_x: DirectionName = "−x"
    plus_y: DirectionName = "+y"
    minus_y: DirectionName = "−y"


if TYPE_CHECKING:
    Language = str
else:
    Language = one_of(LANGUAGES)


class PageSection(Section):
    """The operator's page."""

    enabled: bool = True
    listen: Address = Field("127.0.0.1:8321", description="address:port")
    language: Language = "en"
    directions: DirectionsSection = DirectionsSection()
    hosts: list[str] = Field(
        default_factory=list,
        description="names under which browsers may reach the page, beside its address, such as crane-1.local",
    )
    url: WebAddress | None = Field(
        None,
        description="address of this page for other machines, to which the page of a site links",
    )
    names: list[str] = Field(
        default_factory=list,
        max_length=8,
        description="names offered to a person who acknowledges, for a panel without keys",
    )

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        return host_and_port(self.listen)


class Configuration(Section):
    """The whole configuration."""

    gateway: GatewaySection = GatewaySection()
    device: AnyDevice = SimulatedDevice()
    rope: RopeSection = RopeSection()
    housing: HousingSection = HousingSection()
    site: SiteSection = SiteSection()
    filter: FilterSection = FilterSection()
    alerts: AlertsSection = AlertsSection()
    recorder: RecorderSection = RecorderSection()
    bus: BusSection = BusSection()
    page: PageSection = PageSection()
    relay: AnyRelay = NoRelay()

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        position_m = self.housing.position_m
        if position_m is not None and position_m > self.rope.length_m:
            raise ValueError(f"housing.position_m {position_m:g} is beyond rope.length_m {self.rope.length_m:g}")
        above_m = self.housing.above_load_m
        if above_m is not None and above_m > MAX_ABOVE_LOAD_SHARE * self.rope.length_m:
            raise ValueError(f"housing.above_load_m {above_m:g} is more than rope.length_m {self.rope.length_m:g}")
        rate_hz = getattr(self.device, "odr_hz", None)
        if rate_hz is not None and self.filter.cutoff_hz >= MAX_CUTOFF_SHARE * rate_hz:
            raise ValueError(
                f"filter.cutoff_hz {self.filter.cutoff_hz:g} must stay below {MAX_CUTOFF_SHARE * rate_hz:g}, "
                f"{MAX_CUTOFF_SHARE} of device.odr_hz"
            )
        return self

    @property
    def housing_position_m(self) -> float | None:
        """Pivot to accelerometer along the rope; None where the position is not configured."""
        if self.housing.position_m is not None:
            return self.housing.position_m
        above_m = self.housing_above_load_m
        return None if above_m is None else max(self.rope.length_m - above_m, 0.0)

    @property
    def housing_above_load_m(self) -> float | None:
        """Accelerometer to load along the rope, constant while hoisting; None where the position is given from the pivot."""
        if self.housing.above_load_m is not None or self.housing.position_m is not None:
            return self.housing.above_load_m
        return (1 - SIMULATED_RHO) * self.rope.length_m if isinstance(self.device, SimulatedDevice) else None
