"""The course of an incident: what the recordings state between two times, as arrays."""

from dataclasses import dataclass

from gateway.messages import Calibration, Health
from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class TimedText:
    """A text with its time."""

    time_s: float
    text: str


@dataclass(frozen=True, slots=True)
class ForceCourse:
    """Specific force in the housing frame, by the calibration in force, at the full rate."""

    time_s: Array
    """Gateway time from the origin of the course, shape (n,)."""
    force_g: Array
    """Shape (n, 3)."""


@dataclass(frozen=True, slots=True)
class TimeGap:
    """A time without samples."""

    begin_s: float
    end_s: float


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
class StateCourse:
    """A state in words, from each of its messages until the next."""

    time_s: Array
    state: tuple[str, ...]

    def spans(self, end_s: float) -> list[tuple[float, float, str]]:
        """Return (begin, end, state) without repetitions."""
        found: list[tuple[float, float, str]] = []
        for index, (begin_s, state) in enumerate(zip(self.time_s.tolist(), self.state, strict=True)):
            until_s = float(self.time_s[index + 1]) if index + 1 < len(self.state) else max(end_s, begin_s)
            if found and found[-1][2] == state:
                found[-1] = (found[-1][0], until_s, state)
            else:
                found.append((begin_s, until_s, state))
        return found

    def share_of(self, state: str, end_s: float) -> float | None:
        """Return the share of the time in which a state lasted; None where no state is known."""
        spans = self.spans(end_s)
        total_s = sum(end - begin for begin, end, _ in spans)
        return sum(end - begin for begin, end, each in spans if each == state) / total_s if total_s > 0 else None


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


@dataclass(frozen=True, slots=True)
class Course:
    """Everything that a report shows; seconds count from `origin_ns` of gateway time."""

    origin_ns: int
    begin_ns: int
    end_ns: int
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
    log: tuple[TimedText, ...]
    sessions: tuple[TimedText, ...]
    """The changes of recalibrations, with the person who asked for each."""
    marks: tuple[TimedText, ...]
    """What persons noted, with their names."""
    faults: tuple[TimedText, ...]
    """Faults of the gateway and dropped items, when their number had grown."""
    last_health: Health | None

    @property
    def begin_s(self) -> float:
        """Begin of the course."""
        return (self.begin_ns - self.origin_ns) / 1e9

    @property
    def end_s(self) -> float:
        """End of the course."""
        return (self.end_ns - self.origin_ns) / 1e9

    def utc_ns(self, time_s: float) -> int:
        """Return the UTC of a time of the course."""
        return self.origin_ns + self.wall_offset_ns + round(time_s * 1e9)
