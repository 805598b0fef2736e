"""The contents of recordings as aligned text."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gateway.errors import counted, first_of
from gateway.file_input import parse_json
from gateway.recording.export.recording_info import RecordingInfo
from gateway.recording.format.salvage import describe_losses
from gateway.recording.format.segment_summary import CalibrationState, LogLine, RecordedPeak
from gateway.recording.format.summary_builder import RecordedAlert
from gateway.recording.reading.interval import zoned

LABEL_WIDTH = 15
"""Characters of the first column. Definition: the longest label and a space."""
MAX_LIST_LINES = 20
"""Most lines of a list, of which `--json` has all entries; trips are always listed. Basis: a choice; a screen of a terminal."""
CONFIGURATION_LOG, AUDIT = "plumbline.configuration", "audit "
"""Name and beginning of the lines of the log that are entries of the configuration's audit."""
BY_GATEWAY = ("confirmed", "rolled back")
"""What the gateway does with a change that a person has made."""
MAX_NAMES = 3
"""Names of files in a line. Basis: a choice; the line stays readable."""
LOG_LEVEL_WORDS = {3: "warning", 4: "error", 5: "fatal"}


def info_text(info: RecordingInfo, *, is_local: bool = False) -> str:
    """Return the output of `plumbline record info`, in UTC or in the time zone of this computer."""
    text = _InfoText(info, is_local)
    lines = [f"{label:<{LABEL_WIDTH}}{fact}" for label, fact in text.facts()]
    return "\n".join([*lines, *text.sections()])


@dataclass(frozen=True, slots=True)
class _InfoText:
    info: RecordingInfo
    is_local: bool

    def facts(self) -> Iterator[tuple[str, str]]:
        info = self.info
        yield "recording", f"{info.path}, {info.size_bytes / 1e6:.3f} MB, {self._state()}"
        for remark in info.remarks:
            yield "", remark
        zone = zoned(info.from_utc_ns, is_local=self.is_local).strftime("%Z")
        yield "time", f"{self._time(info.from_utc_ns)} to {self._time(info.to_utc_ns)} {zone}, {info.duration_s:.1f} s"
        yield "clock", self._clock()
        yield "gateway", self._gateway()
        yield "device", self._device()
        at_end = "; in force at the end" if len(info.calibrations) > 1 else ""
        status = info.calibration_status or "status not recorded"
        yield "calibration", f"{info.calibration_id or 'no record'}, {status}{at_end}"
        yield "configuration", "in the file" if info.configuration else "not in every file"
        yield "samples", self._samples()
        yield "largest angle", self._peak(info.largest_angle)
        yield "largest swing", self._peak(info.largest_swing)
        if info.verdict_s:
            yield "conditions", self._conditions()
        if info.recovered:
            yield "recovered", ", ".join(f"{name} {value}" for name, value in info.recovered.items())

    def sections(self) -> Iterator[str]:
        yield from self._alerts()
        yield from self._marks()
        yield from self._calibrations()
        yield from self._configurations()
        yield from self._clock_changes()
        yield from self._gaps()
        yield from self._faults()
        yield from self._log()
        yield from self._topics()

    def _time(self, utc_ns: int) -> str:
        return zoned(utc_ns, is_local=self.is_local).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]

    def _state(self) -> str:
        losses = self.info.losses
        closed = ["closed properly"] if losses.closed and not losses.altered else []
        repaired = [Path(file.path).name for file in self.info.files if file.repaired]
        which = "" if len(self.info.files) == 1 else f"{first_of(repaired, MAX_NAMES)} "
        cut_off = [f"{which}cut off by a kill or a power failure and completed at the next start"] if repaired else []
        return ", ".join(closed + cut_off + describe_losses(losses))

    def _clock(self) -> str:
        clock = self.info.clock
        if clock is None:
            return "not recorded"
        return f"{clock.quality}, UTC {clock.wall_offset_s:+.6f} s from gateway time, {counted(clock.steps, 'step')}"

    def _gateway(self) -> str:
        origin = self.info.origin
        if not origin:
            return "not recorded"
        return f"{self.info.gateway}, software {origin.get('software', '?')}, Python {origin.get('python', '?')}"

    def _device(self) -> str:
        device = self.info.device
        if not device:
            return "not recorded"
        return f"{device.get('kind', '?')} {device.get('device_id', '?')}, {device.get('odr_hz', '?')} Hz nominal"

    def _samples(self) -> str:
        samples = self.info.samples
        if not samples.count:
            return "none"
        rate = "" if samples.rate_hz is None else f" at {samples.rate_hz:.3f} Hz"
        gaps = counted(samples.gaps, "gap")
        if samples.longest_gap_s is not None:
            gaps += f" (longest {samples.longest_gap_s:.3f} s)"
        text = f"{samples.count}{rate}, {samples.lost} lost, {samples.invalid} invalid, {gaps}"
        if samples.missing_blocks:
            text += f", {counted(samples.missing_blocks, 'block')} missing"
        if self.info.bytes_per_sample is None:
            return text
        return f"{text}; {self.info.bytes_per_sample:.2f} bytes per sample with everything else in the file"

    def _peak(self, peak: RecordedPeak | None) -> str:
        if peak is None:
            return "none reported"
        uncertainty = "uncertainty unknown" if peak.u_deg is None else f"u {peak.u_deg:.3f} deg"
        return f"{peak.phi_max_deg:.3f} deg ({uncertainty}) at {self._time(peak.time_ns)}"

    def _conditions(self) -> str:
        total_s = sum(self.info.verdict_s.values())
        shares = sorted(self.info.verdict_s.items(), key=lambda entry: -entry[1])
        return ", ".join(f"{verdict} {seconds / max(total_s, 1e-9):.0%}" for verdict, seconds in shares)

    def _alerts(self) -> Iterator[str]:
        alerts = self.info.alerts
        trips = sum(alert.level == "trip" for alert in alerts)
        yield ""
        least = "at least " if self.info.hidden else ""
        of_them = f"{least}{len(alerts)}, of them {least}{counted(trips, 'trip')}"
        yield f"alerts: {of_them}; no statement on the swing for {self.info.unknown_s:.1f} s"
        others = 0
        for alert in alerts:
            others += alert.level != "trip"
            if alert.level == "trip" or others <= MAX_LIST_LINES:
                yield f"  {self._alert(alert)}"
        yield from _rest(others)

    def _alert(self, alert: RecordedAlert) -> str:
        begin = "since " if alert.is_raised_before else "      "
        if alert.to_utc_ns is None:
            end = "not known at the end" if alert.ended == "unknown" else "still raised at the end"
        else:
            seconds = (alert.to_utc_ns - alert.from_utc_ns) / 1e9
            end = f"{alert.ended} after {seconds:.1f} s"
        least = "" if alert.ended == "cleared" and not alert.is_raised_before else "at least "
        largest = [] if alert.largest_deg is None else [f"largest {least}{alert.largest_deg:.2f} deg"]
        if alert.largest_upper_deg is not None and not least:
            largest.append(f"up to {alert.largest_upper_deg:.2f} deg")
        limit = "" if alert.limit_deg is None else f", limit {alert.limit_deg:.1f} deg"
        bound = ", only an upper bound: the limit was not reached" if alert.is_corrected else ""
        number = "" if alert.incident is None else f"  [{alert.incident}]"
        note = "" if alert.acknowledged_utc_ns is None else self._acknowledgement(alert, alert.acknowledged_utc_ns)
        angles = f"  {', '.join(largest)}{limit}{bound}" if largest or limit else ""
        return f"{begin} {self._time(alert.from_utc_ns)}  {alert.level.upper():<5}{alert.rule:<12}{end}{angles}{number}{note}"

    def _acknowledgement(self, alert: RecordedAlert, utc_ns: int) -> str:
        return f"  acknowledged by {alert.acknowledged_by} at {self._time(utc_ns)}"

    def _marks(self) -> Iterator[str]:
        marks = self.info.marks
        return _section(
            f"marks: {len(marks)}",
            [
                f"{self._time(each.utc_ns)}  {each.text} ({each.by}{f': {each.reason}' if each.reason else ''})"
                for each in marks
            ],
        )

    def _calibrations(self) -> Iterator[str]:
        changes = self.info.calibrations[1:]
        lines = [f"{self._time(change.utc_ns)}  {_calibration_text(change)}" for change in changes]
        return _section(f"calibration: {counted(len(changes), 'change')}", lines)

    def _clock_changes(self) -> Iterator[str]:
        changes = [] if self.info.clock is None else self.info.clock.changes[1:]
        lines = []
        for change in changes:
            step = "stepped, " if change.stepped else ""
            utc = self._time(change.log_time_ns + change.wall_offset_ns)
            lines.append(f"{utc}  {step}{change.quality}, UTC {change.wall_offset_ns / 1e9:+.6f} s from gateway time")
        return _section(f"clock: {counted(len(changes), 'change')}", lines)

    def _gaps(self) -> Iterator[str]:
        longest = sorted(self.info.gaps, key=lambda gap: -gap.length_s)[:MAX_LIST_LINES]
        if longest:
            yield ""
            yield f"gaps: {self.info.samples.gaps}, {self.info.samples.gap_s:.3f} s together"
        for gap in sorted(longest, key=lambda gap: gap.from_utc_ns):
            until = f"{self._time(gap.from_utc_ns)} to {self._time(gap.to_utc_ns)}"
            yield f"  {until}  {gap.length_s:.3f} s, {gap.missing} samples: {gap.cause}"
        if self.info.samples.gaps > len(longest):
            yield f"  and {self.info.samples.gaps - len(longest)} shorter ones"

    def _faults(self) -> Iterator[str]:
        times = Counter(fault.name for fault in self.info.faults)
        if times:
            yield ""
            yield f"faults: {counted(len(times), 'kind')}"
        for name in times:
            of_kind = [fault for fault in self.info.faults if fault.name == name]
            first, last = of_kind[0], of_kind[-1]
            yield f"  {name}: {last.count}, first at {self._time(first.utc_ns)}, last at {self._time(last.utc_ns)}"

    def _configurations(self) -> Iterator[str]:
        found = [(line, text) for line in self.info.log if (text := _configuration_text(line)) is not None]
        applied = sum(text.startswith("applied") for _, text in found)
        title = (
            f"configuration: {counted(applied, 'change')} applied over the bus, {counted(len(found), 'step')} in all"
        )
        return _section(title, [f"{self._time(line.utc_ns)}  {text}" for line, text in found])

    def _log(self) -> Iterator[str]:
        others = [line for line in self.info.log if _configuration_text(line) is None]
        lines = [
            f"{self._time(line.utc_ns)}  {LOG_LEVEL_WORDS.get(line.level, line.level):<8}{line.message}"
            for line in others
        ]
        count = self.info.log_count - len(self.info.log) + len(others)
        return _section(f"log: {count} warnings and errors", lines, count)

    def _topics(self) -> Iterator[str]:
        yield ""
        width = max((len(topic.topic) for topic in self.info.topics), default=0)
        for topic in self.info.topics:
            rate = "" if topic.rate_hz is None else f"{topic.rate_hz:10.3f} Hz"
            yield f"{topic.topic:<{width}}{topic.count:>10}{rate}{topic.bytes / 1e6:>12.3f} MB  {topic.schema}"


def _calibration_text(change: CalibrationState) -> str:
    text = f"{change.calibration_id or 'no record'}, {change.status}"
    session = f"; recalibration {change.phase}, begun by {change.by or '?'}: {change.session_text}"
    return text if change.phase == "idle" else text + session


def _configuration_text(line: LogLine) -> str | None:
    """Return an entry of the audit of the configuration as a sentence; None: the line is something else."""
    if line.name != CONFIGURATION_LOG or not line.message.startswith(AUDIT):
        return None
    try:
        entry = parse_json(line.message.removeprefix(AUDIT))
        what = entry["event"].replace("_", " ")
        text = f"change by {entry['by']} {what} by the gateway" if what in BY_GATEWAY else f"{what} by {entry['by']}"
        reason = entry["reason"] or entry.get("proposed_reason", "")
        text += f" ({reason})" if reason else ""
        return ": ".join(filter(None, [text, "; ".join(entry.get("changes") or []), entry.get("why")]))
    except (ValueError, LookupError, TypeError, AttributeError):
        return None


def _section(title: str, lines: Sequence[str], count: int | None = None) -> Iterator[str]:
    """Yield a list of `count` entries under its title, as far as it is shown; nothing where it is empty."""
    if lines:
        yield ""
        yield title
        yield from (f"  {line}" for line in lines[:MAX_LIST_LINES])
        yield from _rest(len(lines) if count is None else count)


def _rest(count: int) -> Iterator[str]:
    if count > MAX_LIST_LINES:
        yield f"  and {count - MAX_LIST_LINES} more; --json has all of them"
