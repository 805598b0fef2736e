"""Collects the course of an incident from the messages of recordings."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gateway.documents.format import human_name
from gateway.incident.course import (
    BEFORE_REPORT,
    CUT_OFF,
    MOTION_NUMBERS,
    TRUSTED_TEXT,
    Course,
    ForceCourse,
    MotionCourse,
    SampleCounts,
    TimedText,
)
from gateway.incident.gateway_runs import HolesS, RunRegister, StateCourse
from gateway.incident.sample_gaps import BlockPlace, find_gaps
from gateway.incident.setting_changes import (
    AuditEntry,
    ConfigurationInForce,
    parse_audit,
    setting_changes,
)
from gateway.messages import (
    NO_SESSION,
    SOURCES,
    Alert,
    Calibration,
    CalibrationSession,
    ClockOffset,
    Condition,
    Health,
    Log,
    Mark,
    Motion,
)
from gateway.numerics.array import Array
from gateway.pipeline.alert_rules import RULE_NAMES
from gateway.recording.export.gaps import AbsenceCauses
from gateway.recording.format.content import CUT
from gateway.recording.reading.recording_file import SegmentIndex
from gateway.recording.reading.sample_calibration import CalibratedBlock

NOTHING_STATED = AbsenceCauses()
Entry = TypeVar("Entry")


@dataclass(slots=True)
class CourseBuilder:
    """Takes the messages in the order of writing; times count from `origin_ns`."""

    origin_ns: int
    _motion: list[list[float]] = field(default_factory=list)
    _motion_state: list[str] = field(default_factory=list)
    _places: list[BlockPlace] = field(default_factory=list)
    _force_g: list[Array] = field(default_factory=list)
    """The specific force of each block."""
    _lost: int = 0
    _invalid: int = 0
    _states: dict[str, list[tuple[float, str]]] = field(default_factory=dict)
    _clock: list[tuple[float, ClockOffset]] = field(default_factory=list)
    _runs: RunRegister = field(default_factory=RunRegister)
    _configurations: list[ConfigurationInForce] = field(default_factory=list)
    _audit: list[AuditEntry] = field(default_factory=list)
    _calibrations: list[tuple[float, Calibration]] = field(default_factory=list)
    _log: list[TimedText] = field(default_factory=list)
    _health: Health | None = None
    _own_health: Health | None = None
    _device_kinds: set[str] = field(default_factory=set)
    _session: CalibrationSession = NO_SESSION
    _sessions: list[TimedText] = field(default_factory=list)
    _marks: list[TimedText] = field(default_factory=list)
    _faults: list[TimedText] = field(default_factory=list)

    def add_device_kind(self, kind: str) -> None:
        """Take the kind of a device that a file describes."""
        self._device_kinds.add(kind)

    def add_run(self, time_ns: int, boot_id: str, configuration_toml: str | None) -> None:
        """Take the time of any message, the run that it is of, and the configuration that is in force."""
        time_s = (time_ns - self.origin_ns) / 1e9
        self._runs.add(time_s, boot_id)
        known = self._configurations[-1].toml if self._configurations else None
        if configuration_toml is not None and configuration_toml != known:
            self._configurations.append(ConfigurationInForce(time_s, configuration_toml))

    def add_block(self, block: CalibratedBlock) -> None:
        """Take a block of samples, of the run that was added last."""
        boot_id = self._runs.runs[-1].boot_id if self._runs.runs else ""
        self._places.append(self.place(block.block.time_ns, block.segment, boot_id, block.sequence))
        self._force_g.append(block.force_g)
        self._lost += block.block.lost
        self._invalid += block.block.invalid

    def add(self, time_ns: int, content: object) -> None:
        """Take the content of a message with its gateway time."""
        time_s = (time_ns - self.origin_ns) / 1e9
        match content:
            case Motion():
                self._add_motion(time_s, content)
            case Calibration():
                if not self._calibrations or _in_force(self._calibrations[-1][1]) != _in_force(content):
                    self._calibrations.append((time_s, content))
                self._add_session(time_s, content.session)
                by = content.session.by or "an unnamed person"
                self._add_state("suspended", time_s, by if content.session.suspended else "")
            case Mark():
                reason = f" ({content.reason})" if content.reason else ""
                self._marks.append(TimedText(time_s, f"{content.by or 'an unnamed person'}: {content.text}{reason}"))
            case Log():
                self._add_line(time_s, content)
            case _:
                self._add_states(time_s, content)

    def place(self, time_ns: NDArray[np.int64], segment: SegmentIndex, boot_id: str, sequence: int) -> BlockPlace:
        """Return the place of a block."""
        unread_ns = segment.to_ns - int(time_ns[-1])
        return BlockPlace((time_ns - self.origin_ns) / 1e9, segment, boot_id, sequence, unread_ns)

    def course(
        self,
        begin_ns: int,
        end_ns: int,
        before: BlockPlace | None = None,
        after: BlockPlace | None = None,
        causes: AbsenceCauses = NOTHING_STATED,
        *,
        end_cause: str = CUT_OFF,
        checked_ns: int | None = None,
    ) -> Course:
        """Return the course of everything that was added.

        `before` and `after`: the blocks next to it in the recordings, None: there is none; `causes`: of what is missing;
        `end_cause`: why nothing follows where the recordings end; `checked_ns`: `Course.checked_s`.
        """
        span_s = (begin_ns - self.origin_ns) / 1e9, (end_ns - self.origin_ns) / 1e9
        if after is not None:  # a restart that comes later belongs to the end of the run
            self._runs.add((after.segment.from_ns - self.origin_ns) / 1e9, after.boot_id)
        acceleration, counts = self._acceleration(before, after, span_s, causes)
        holes_s = [(gap.begin_s, gap.end_s) for gap in counts.gaps if gap.is_hole]
        states = {name: self._state_course(rows, holes_s) for name, rows in self._states.items()}
        nothing = self._state_course([], [])
        suspended = states.get("suspended", nothing)
        for from_s, to_s, by in suspended.spans(span_s[1]):
            if by:
                acceleration = acceleration.part((acceleration.time_s < from_s) | (acceleration.time_s > to_s))
        alert_levels = {rule: states[rule] for rule in RULE_NAMES if rule in states}
        return Course(
            origin_ns=self.origin_ns,
            begin_ns=begin_ns,
            end_ns=end_ns,
            checked_s=((end_ns if checked_ns is None else checked_ns) - self.origin_ns) / 1e9,
            wall_offset_ns=self._wall_offset_ns(),
            motion=self._motion_course(holes_s),
            acceleration=acceleration,
            samples=counts,
            condition=states.get("condition", nothing),
            trusted=states.get("trusted", nothing),
            alert_levels=alert_levels,
            health=states.get("health", nothing),
            clock=states.get("clock", nothing),
            clock_steps_s=tuple(time_s for time_s, clock in self._clock if clock.stepped),
            calibrations=_from(self._calibrations, [time_s for time_s, _ in self._calibrations], span_s[0]),
            restarts=self._runs.restarts(states.get("health", nothing), alert_levels, counts.gaps),
            configurations=_from(self._configurations, [each.time_s for each in self._configurations], span_s[0]),
            setting_changes=setting_changes(self._configurations, self._audit),
            log=tuple(self._log),
            sessions=tuple(self._sessions),
            suspended=suspended,
            marks=tuple(self._marks),
            faults=tuple(self._faults),
            last_health=self._own_health,
            source=next((word for kind, word in SOURCES.items() if kind in self._device_kinds), ""),
            begin_cause=self._begin_cause(before, causes),
            end_cause="" if after is not None or self._is_cut_out else end_cause,
        )

    def _add_states(self, time_s: float, content: object) -> None:
        match content:
            case Condition():
                self._add_state("condition", time_s, content.verdict)
                self._add_state("trusted", time_s, TRUSTED_TEXT if content.trusted else "; ".join(content.reasons))
            case Alert():
                levels = {active.rule: active.level for active in content.active}
                for rule in RULE_NAMES:
                    self._add_state(rule, time_s, levels.get(rule, "normal"))
            case Health():
                own = self._own_health
                self._own_health = content if own is None or time_s <= 0 or content.boot_id == own.boot_id else own
                self._device_kinds.add(content.device_kind)
                self._add_faults(time_s, content)
                self._add_state("health", time_s, content.state)
            case ClockOffset():
                self._clock.append((time_s, content))
                self._device_kinds.update(["replay"] if content.clock == "replayed" else [])
                self._add_state("clock", time_s, content.clock)
            case _:
                pass

    def _add_session(self, time_s: float, session: CalibrationSession) -> None:
        if (session.id, session.phase) != (self._session.id, self._session.phase):
            by = f", begun by {session.by}" if session.by else ""
            self._sessions.append(TimedText(time_s, f"Recalibration {session.phase}{by}. {session.text}"))
        self._session = session

    def _add_faults(self, time_s: float, health: Health) -> None:
        before = _fault_counts(health if self._health is None else self._health)
        for name, count in _fault_counts(health).items():
            if (more := count - before.get(name, 0)) > 0:
                self._faults.append(TimedText(time_s, f"{name}: {more} more"))
        self._health = health

    def _add_line(self, time_s: float, line: Log) -> None:
        entry = parse_audit(time_s, line.message)
        if entry is not None:
            self._audit.append(entry)
        self._log.append(TimedText(time_s, line.message if entry is None else entry.words))

    def _begin_cause(self, before: BlockPlace | None, causes: AbsenceCauses) -> str:
        if before is not None or not self._places:
            return BEFORE_REPORT
        return causes.before(self._places[0].segment, self._places[0].sequence)

    @property
    def _is_cut_out(self) -> bool:
        return bool(self._places) and CUT in self._places[-1].segment.metadata

    def _state_course(self, rows: list[tuple[float, str]], holes_s: HolesS) -> StateCourse:
        ordered = sorted(rows, key=lambda row: row[0])
        return self._runs.states(
            np.array([time_s for time_s, _ in ordered], dtype=np.float64),
            tuple(state for _, state in ordered),
            holes_s,
        )

    def _add_state(self, name: str, time_s: float, state: str) -> None:
        self._states.setdefault(name, []).append((time_s, state))

    def _add_motion(self, time_s: float, motion: Motion) -> None:
        pivot_m_s2 = motion.pivot_accel_m_s2 or [np.nan, np.nan]
        numbers: list[Any] = [getattr(motion, name) for name in MOTION_NUMBERS]
        self._motion.append([time_s, *(np.nan if each is None else each for each in numbers), *pivot_m_s2])
        self._motion_state.append(motion.state)

    def _motion_course(self, holes_s: HolesS) -> MotionCourse:
        table = np.array(self._motion, dtype=np.float64).reshape(-1, 3 + len(MOTION_NUMBERS))
        order = np.argsort(table[:, 0], kind="stable")
        table = table[order]
        columns = dict(zip(MOTION_NUMBERS, table[:, 1:-2].T, strict=True))
        states = self._runs.states(table[:, 0], tuple(self._motion_state[index] for index in order), holes_s)
        return MotionCourse(time_s=table[:, 0], pivot_m_s2=table[:, -2:], states=states, **columns)

    def _acceleration(
        self, before: BlockPlace | None, after: BlockPlace | None, span_s: tuple[float, float], causes: AbsenceCauses
    ) -> tuple[ForceCourse, SampleCounts]:
        if not self._places:
            empty = ForceCourse(np.zeros(0), np.zeros((0, 3)))
            return empty, SampleCounts(0, None, self._lost, self._invalid, ())
        time_s, force_g = np.concatenate([block.time_s for block in self._places]), np.concatenate(self._force_g)
        order = np.argsort(time_s, kind="stable")
        time_s, force_g = time_s[order], force_g[order]
        period_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
        blocks = sorted(self._places, key=lambda block: float(block.time_s[0]))
        gaps = find_gaps(blocks, before, after, span_s, period_s, causes)
        rate_hz = 1 / period_s if period_s > 0 else None
        return ForceCourse(time_s, force_g), SampleCounts(len(time_s), rate_hz, self._lost, self._invalid, gaps)

    def _wall_offset_ns(self) -> int:
        before = [clock for time_s, clock in self._clock if time_s <= 0]
        known = before[-1:] or [clock for _, clock in self._clock[:1]]
        return known[0].wall_offset_ns if known else 0


def _from(entries: Sequence[Entry], times_s: Sequence[float], begin_s: float) -> tuple[Entry, ...]:
    """Return what was in force at the begin, and what came later; messages before the begin state it."""
    return tuple(entries[max(0, bisect_right(times_s, begin_s) - 1) :])


def _in_force(calibration: Calibration) -> tuple[object, ...]:
    return calibration.calibration_id, calibration.status, calibration.in_force


def _fault_counts(health: Health) -> dict[str, int]:
    dropped = {f"dropped by the {name}": count for name, count in health.dropped.items()}
    return {human_name(name): count for name, count in health.faults.items()} | dropped
