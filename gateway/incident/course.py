"""The course of an incident: what the recordings state between two times, as arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.incident.gateway_runs import GatewayRestart, StateCourse
from gateway.incident.sample_gaps import TimeGap
from gateway.incident.setting_changes import (
    DEFAULT_FSYNC_S,
    DEFAULT_HOLD_S,
    ConfigurationInForce,
    SettingChange,
)
from gateway.messages import (
    Calibration,
    Health,
)
from gateway.numerics.array import Array

COURSE_TOPICS = frozenset({"/motion", "/condition", "/alert", "/health", "/calibration", "/mark", "/clock", "/log"})
"""The topics of which a course is made, beside the samples."""
MOTION_NUMBERS = ("angle_deg", "u_deg", "azimuth_deg", "hoist_m_s", "hoist_u_m_s", "length_m", "lean_deg", "lean_u_deg")
MAX_ALERT_SILENCE_S = 5.0
"""An alert is stated each second. Basis: after a longer silence the gateway has ended."""
TRUSTED_TEXT = "trusted"
BEFORE_REPORT = "before the time of this report"
CUT_OFF = "Nothing says that the gateway was stopped: it was killed, lost its power, still runs, or files are missing"
STOPPED = "The gateway was stopped then, and said so: nothing of these recordings is later"
REPAIRED = (
    "The gateway was killed or lost its power; it completed this file at a later start, and recorded nothing after it"
)
REPAIRED_LATER = (
    "The gateway was killed or lost its power, and was started again later: it completed this file then, and what it recorded "
    "from then on is not in these files"
)


@dataclass(frozen=True, slots=True)
class TimedText:
    """A text with its time."""

    time_s: float
    text: str


@dataclass(frozen=True, slots=True)
class ForceCourse:
    """Specific force in the housing frame while it hung on the rope, by the calibration in force, at the full rate."""

    time_s: Array
    """Gateway time from the origin of the course, shape (n,)."""
    force_g: Array
    """Shape (n, 3)."""

    def part(self, kept: NDArray[np.bool_]) -> "ForceCourse":
        """Return some of the samples, by a mask of shape (n,)."""
        return ForceCourse(self.time_s[kept], self.force_g[kept])

    def between(self, begin_s: float, end_s: float) -> "ForceCourse":
        """Return the samples between two times."""
        return self.part((self.time_s >= begin_s) & (self.time_s <= end_s))


@dataclass(frozen=True, slots=True)
class SampleCounts:
    """The samples between begin and end."""

    count: int
    rate_hz: float | None
    lost: int
    """Number of samples that the device or the link is known to have lost."""
    invalid: int
    gaps: tuple[TimeGap, ...]


@dataclass(frozen=True, slots=True)
class MotionCourse:
    """The motion, ten values a second; NaN where a number is not known."""

    time_s: Array
    angle_deg: Array
    u_deg: Array
    azimuth_deg: Array
    pivot_m_s2: Array
    """Shape (n, 2)."""
    hoist_m_s: Array
    hoist_u_m_s: Array
    length_m: Array
    lean_deg: Array
    lean_u_deg: Array
    states: StateCourse
    """`rest`, `free`, `driven`, `hoisting`, `wind` or `unknown`."""

    def angle_at_deg(self, time_s: float) -> float | None:
        """Return the angle of the last message up to a time; None where there is none, or it was not known."""
        place = int(np.searchsorted(self.time_s, time_s, side="right")) - 1
        return float(self.angle_deg[place]) if place >= 0 and np.isfinite(self.angle_deg[place]) else None


@dataclass(frozen=True, slots=True)
class Course:
    """Everything that a report shows; seconds count from `origin_ns` of gateway time."""

    origin_ns: int
    begin_ns: int
    end_ns: int
    checked_s: float
    """Up to this time the recordings were searched for changes of the incident, and are checked."""
    wall_offset_ns: int
    """UTC minus gateway time, by the last message of the clock before the origin, or the first one."""
    motion: MotionCourse
    acceleration: ForceCourse
    samples: SampleCounts
    condition: StateCourse
    trusted: StateCourse
    """`trusted`, or the reasons why not."""
    alert_levels: dict[str, StateCourse]
    health: StateCourse
    clock: StateCourse
    clock_steps_s: tuple[float, ...]
    """Times at which the wall clock stepped."""
    calibrations: tuple[tuple[float, Calibration], ...]
    """The calibration in force at the begin, and each later one, with its time."""
    restarts: tuple[GatewayRestart, ...]
    configurations: tuple[ConfigurationInForce, ...]
    """The configuration in force at the begin, and each later one."""
    setting_changes: tuple[SettingChange, ...]
    log: tuple[TimedText, ...]
    sessions: tuple[TimedText, ...]
    """The changes of recalibrations, with the person who asked for each."""
    suspended: StateCourse
    """Who recalibrated the sensor while no alert was judged; empty: alerts were judged."""
    marks: tuple[TimedText, ...]
    """What persons noted, with their names."""
    faults: tuple[TimedText, ...]
    """Faults of the gateway and dropped items, when their number had grown."""
    last_health: Health | None
    """Of the run in which the origin lies."""
    source: str
    """SIMULATION or REPLAY; empty where a sensor took all samples."""
    begin_cause: str
    """Why nothing before the begin is in this course."""
    end_cause: str
    """Why nothing follows the end where the recordings end with it; empty where they go on."""

    @property
    def holes(self) -> tuple[TimeGap, ...]:
        """The gaps in the recordings, in contrast to those in the samples."""
        return tuple(gap for gap in self.samples.gaps if gap.is_hole)

    def is_whole(self, begin_s: float, end_s: float) -> bool:
        """Return whether nothing is missing in the recordings between two times, from the begin on."""
        return not any(gap.within_s(begin_s, end_s) for gap in self.holes)

    @property
    def suspensions(self) -> tuple[TimeGap, ...]:
        """The times in which the sensor was recalibrated, off the rope, and no alert was judged."""
        spans = self.suspended.spans(self.end_s)
        return tuple(TimeGap(begin_s, end_s, f"recalibrated by {by}") for begin_s, end_s, by in spans if by)

    @property
    def hidden(self) -> tuple[TimeGap, ...]:
        """The times in which the load's motion is not in the samples: there are none, or the sensor was off the rope."""
        return tuple(sorted((*self.samples.gaps, *self.suspensions), key=lambda gap: gap.begin_s))

    def recorded_until_s(self, time_s: float) -> float:
        """Return up to when something follows a time: to the end of that run, of the recordings, or to a hole in them.

        An alert that stood at that time is no longer stated after it: where much follows, that time itself.
        """
        ends_s = [each.stopped_s for each in self.restarts] + [gap.begin_s for gap in self.holes] + [self.end_s]
        until_s = min((each for each in ends_s if each >= time_s), default=time_s)
        return until_s if until_s - time_s <= MAX_ALERT_SILENCE_S else time_s

    @property
    def begin_s(self) -> float:
        """Begin of the course."""
        return self.time_s(self.begin_ns)

    @property
    def end_s(self) -> float:
        """End of the course."""
        return self.time_s(self.end_ns)

    def time_s(self, time_ns: int) -> float:
        """Return a gateway time as a time of the course."""
        return (time_ns - self.origin_ns) / 1e9

    def fsync_s(self, time_s: float) -> float:
        """Return how long the gateway may have run after what is recorded last, by the configuration in force."""
        known = [each.fsync_s for each in self.configurations if each.time_s <= time_s]
        return known[-1] if known else DEFAULT_FSYNC_S

    def hold_s(self, time_s: float) -> float:
        """Return how long an angle must be below the level at which an alert clears, by the configuration in force."""
        known = [each.number("alerts.hold_s") for each in self.configurations if each.time_s <= time_s]
        return DEFAULT_HOLD_S if not known or known[-1] is None else known[-1]

    def gateway_ns(self, time_s: float) -> int:
        """Return the gateway time of a time of the course."""
        return self.origin_ns + round(time_s * 1e9)

    def utc_ns(self, time_s: float) -> int:
        """Return the UTC of a time of the course."""
        return self.gateway_ns(time_s) + self.wall_offset_ns
