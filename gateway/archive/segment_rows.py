"""The rows of a recording, from one pass over its messages."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import msgspec

from gateway.archive.rows import (
    TABLES,
    AlertRow,
    CalibrationRow,
    ClockRow,
    ConditionRow,
    HealthRow,
    MotionMinute,
    MotionSecond,
    SwingRow,
    row_of,
)
from gateway.messages import Alert, Calibration, ClockOffset, Condition, Health, Motion, Swing
from gateway.numerics.stats import NORMAL_975
from gateway.recording.format.salvage import SalvageReport
from gateway.recording.format.segment_summary import SegmentSummary
from gateway.recording.format.summary_builder import MAX_VERDICT_S, SummaryBuilder, join_alerts
from gateway.recording.reading.recording_file import Selection, open_recording

NS_PER_S = 1_000_000_000
NS_PER_MINUTE = 60 * NS_PER_S
TOPICS_READ = frozenset({"/motion", "/swing", "/condition", "/alert", "/health", "/calibration", "/clock"})
LEAST_PERIOD_S = 1.0
"""Two swings are at least so far apart. Basis: a choice; the period of a rope of 0.25 m, shorter than any crane's."""
NUMBER = re.compile(r"[-+]?\d[\d.]*")


@dataclass(frozen=True, slots=True)
class SegmentRows:
    """The rows of a recording by table; times are gateway times."""

    rows: Mapping[str, Sequence[Any]]
    wall_offset_ns: int
    """UTC of the wall clock minus gateway time, by the last message of the clock: it holds for the whole segment, so that a clock
    that was set in its middle does not tear it in two."""
    from_ns: int
    to_ns: int
    losses: SalvageReport


def read_rows(path: Path) -> SegmentRows:
    """Return the rows of a recording. Raises `RecordingError` where it cannot be read."""
    file = open_recording(path)
    reader = _SegmentReader()
    for recorded in file.messages(Selection(topics=TOPICS_READ)):
        content = file.decode(recorded)
        if content is not None:
            reader.summary.count(recorded.topic, recorded.log_time_ns, 0)
            reader.add(recorded.log_time_ns, content)
    return reader.finish(file.losses)


@dataclass(slots=True)
class _SegmentReader:
    """Takes the messages in the order of writing."""

    summary: SummaryBuilder = field(default_factory=SummaryBuilder)
    _rows: dict[str, list[Any]] = field(default_factory=lambda: {name: [] for name in TABLES})
    _motion: list[tuple[int, Motion]] = field(default_factory=list)
    """Those of one second."""
    _swing: SwingRow | None = None
    """The largest one of the present period."""
    _swing_from_ns: int = 0
    _validity: str | None = None
    _span: ConditionRow | None = None
    _condition_ns: int = 0
    _calibration: tuple[object, ...] | None = None

    def add(self, time_ns: int, content: object) -> None:
        """Take the content of a message with its gateway time."""
        match content:
            case Motion():
                if self._motion and self._motion[0][0] // NS_PER_S != time_ns // NS_PER_S:
                    self._end_second()
                self._motion.append((time_ns, content))
            case Swing():
                self._add_swing(time_ns, content)
            case Condition():
                self._add_condition(time_ns, content)
            case Alert():
                self._validity = content.validity
                self.summary.add(content, time_ns)
            case ClockOffset():
                self.summary.add(content, time_ns)
            case Health():
                self._add_health(time_ns, content)
            case Calibration():
                self._add_calibration(time_ns, content)

    def finish(self, losses: SalvageReport) -> SegmentRows:
        """Return the rows of everything that was added."""
        if self._motion:
            self._end_second()
        for table, last in (("swings", self._swing), ("conditions", self._span)):
            if last is not None:
                self._rows[table].append(last)
        summary = self.summary.summary()
        if summary is None:
            return SegmentRows(self._rows, 0, 0, 0, losses)
        self._rows["minutes"] = _minutes(self._rows["motion"], summary.wall_offset_ns)
        self._rows["alerts"] = _alerts(summary)
        self._rows["clock"] = [row_of(ClockRow, each, gateway_time_ns=each.log_time_ns) for each in summary.clock]
        return SegmentRows(self._rows, summary.wall_offset_ns, summary.from_ns, summary.to_ns, losses)

    def _end_second(self) -> None:
        last = self._motion[-1][1]
        known = [(each.angle_deg, each.u_deg or 0.0) for _, each in self._motion if each.angle_deg is not None]
        angles = [angle for angle, _ in known]
        self._rows["motion"].append(
            MotionSecond(
                gateway_time_ns=self._motion[0][0] // NS_PER_S * NS_PER_S,
                state=last.state,
                value_count=len(self._motion),
                known_count=len(known),
                angle_deg=angles[-1] if angles else None,
                angle_min_deg=min(angles, default=None),
                angle_max_deg=max(angles, default=None),
                upper_max_deg=max((angle + NORMAL_975 * u for angle, u in known), default=None),
                lean_deg=last.lean_deg,
                length_m=last.length_m,
                calibration_id=last.calibration_id,
            )
        )
        self._motion = []

    def _add_swing(self, time_ns: int, message: Swing) -> None:
        """Keep the largest estimate of each period: the topic has three of the same swing."""
        if not message.swinging or message.phi_max_deg is None:
            return
        found = row_of(SwingRow, message, gateway_time_ns=time_ns)
        if self._swing is not None:
            period_s = max(self._swing.period_s or LEAST_PERIOD_S, LEAST_PERIOD_S)
            if time_ns - self._swing_from_ns < period_s * NS_PER_S:
                if found.phi_max_deg > self._swing.phi_max_deg:
                    self._swing = found
                return
            self._rows["swings"].append(self._swing)
        self._swing, self._swing_from_ns = found, time_ns

    def _add_condition(self, time_ns: int, message: Condition) -> None:
        """Lengthen the present span, or begin another one."""
        reason = NUMBER.sub("#", message.reasons[0]) if message.reasons else None
        found = (message.verdict, message.cause, message.trusted, self._validity, reason)
        before = self._span
        if before is not None:
            lasted_s = min(max(time_ns - self._condition_ns, 0) / NS_PER_S, MAX_VERDICT_S)
            before = self._span = replace(before, duration_s=before.duration_s + lasted_s)
        self._condition_ns = time_ns
        if before is not None and found == (
            before.verdict,
            before.cause,
            before.trusted,
            before.validity,
            before.reason,
        ):
            return
        if before is not None:
            self._rows["conditions"].append(before)
        said = {"validity": self._validity, "reason": reason}
        self._span = row_of(ConditionRow, message, gateway_time_ns=time_ns, duration_s=0.0, **said)

    def _add_health(self, time_ns: int, message: Health) -> None:
        """Keep the last message of each minute."""
        rows = self._rows["health"]
        if rows and rows[-1].gateway_time_ns // NS_PER_MINUTE == time_ns // NS_PER_MINUTE:
            rows.pop()
        drift = message.drift or {}
        error_mg = drift.get("norm_error_mg")
        rows.append(
            row_of(
                HealthRow,
                message,
                gateway_time_ns=time_ns,
                faults=sum(message.faults.values()),
                standing_faults=", ".join(sorted(message.standing_faults)),
                dropped=sum(message.dropped.values()),
                drift_state=None if drift.get("state") is None else str(drift["state"]),
                drift_norm_error_mg=float(error_mg) if isinstance(error_mg, int | float) else None,
            )
        )

    def _add_calibration(self, time_ns: int, message: Calibration) -> None:
        key = (message.status, message.calibration_id, message.device_id, message.record.get("sha256"))
        if key == self._calibration:
            return
        self._calibration = key
        record = msgspec.json.encode(message.record).decode() if message.record else ""
        self._rows["calibrations"].append(row_of(CalibrationRow, message, gateway_time_ns=time_ns, record=record))


def _minutes(seconds: Sequence[MotionSecond], wall_offset_ns: int) -> list[MotionMinute]:
    """Return the extremes of each minute of gateway time."""
    return [
        _minute(minute * NS_PER_MINUTE, list(group), wall_offset_ns)
        for minute, group in groupby(seconds, lambda row: row.gateway_time_ns // NS_PER_MINUTE)
    ]


def _minute(time_ns: int, seconds: Sequence[MotionSecond], wall_offset_ns: int) -> MotionMinute:
    known = [row for row in seconds if row.angle_max_deg is not None]
    largest = max(known, key=lambda row: row.angle_max_deg or 0.0, default=None)
    return MotionMinute(
        gateway_time_ns=time_ns,
        seconds=len(seconds),
        known_s=sum(row.known_count / row.value_count for row in seconds),
        angle_max_deg=None if largest is None else largest.angle_max_deg,
        upper_max_deg=max((row.upper_max_deg for row in known if row.upper_max_deg is not None), default=None),
        largest_utc=None if largest is None else largest.gateway_time_ns + wall_offset_ns,
    )


def _alerts(summary: SegmentSummary) -> list[AlertRow]:
    return [
        row_of(
            AlertRow,
            each,
            gateway_time_ns=each.from_utc_ns - summary.wall_offset_ns,
            end_utc=each.to_utc_ns,
            is_acknowledged=each.acknowledged_by is not None,
        )
        for each in join_alerts([("", summary)])
    ]
