"""The contents of a recording as aligned text."""

from collections.abc import Iterator
from datetime import UTC, datetime

from gateway.recording.info import RecordingInfo
from gateway.recording.mcap_salvage import describe_losses

MOST_ALERTS = 20
LABEL_WIDTH = 15


def info_text(info: RecordingInfo) -> str:
    """Return the output of `plumbline record info`."""
    lines = [f"{label:<{LABEL_WIDTH}}{text}" for label, text in _facts(info)]
    return "\n".join([*lines, "", *_topic_lines(info), *_alert_lines(info)])


def utc_text(time_ns: int) -> str:
    """Return a time as text, to the millisecond."""
    return datetime.fromtimestamp(time_ns / 1e9, tz=UTC).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] + " UTC"


def _facts(info: RecordingInfo) -> Iterator[tuple[str, str]]:
    yield "recording", f"{info.path}, {info.size_bytes / 1e6:.3f} MB, {_state(info)}"
    yield "time", f"{utc_text(info.from_utc_ns)} to {utc_text(info.to_utc_ns)}, {info.duration_s:.1f} s"
    yield "clock", _clock(info)
    yield "gateway", _gateway(info)
    yield "device", _device(info)
    yield "calibration", f"{info.calibration_id or 'no record'}, {info.calibration_status or 'status not recorded'}"
    yield "configuration", "in the file" if info.configuration else "not in the file"
    yield "samples", _samples(info)
    yield "largest swing", _swing(info)
    if info.recovered:
        yield "recovered", ", ".join(f"{name} {value}" for name, value in info.recovered.items())


def _state(info: RecordingInfo) -> str:
    closed = ["closed properly"] if info.closed else []
    return ", ".join(closed + describe_losses(info.losses))


def _clock(info: RecordingInfo) -> str:
    if info.clock is None:
        return "not recorded"
    return f"{info.clock.quality}, UTC {info.clock.wall_offset_s:+.6f} s from gateway time, {info.clock.steps} steps"


def _gateway(info: RecordingInfo) -> str:
    origin = info.origin
    if not origin:
        return "not recorded"
    place = "/".join(origin.get(name, "?") for name in ("site", "crane", "sensor"))
    return f"{place}, software {origin.get('software', '?')}, Python {origin.get('python', '?')}"


def _device(info: RecordingInfo) -> str:
    device = info.device
    if not device:
        return "not recorded"
    return f"{device.get('kind', '?')} {device.get('device_id', '?')}, {device.get('odr_hz', '?')} Hz nominal"


def _samples(info: RecordingInfo) -> str:
    samples = info.samples
    if not samples.count or info.bytes_per_sample is None:
        return "none"
    rate = "" if samples.rate_hz is None else f" at {samples.rate_hz:.3f} Hz"
    gaps = f"{samples.gaps} gaps"
    if samples.longest_gap_s is not None:
        gaps += f" (longest {samples.longest_gap_s:.3f} s)"
    text = f"{samples.count}{rate}, {samples.lost} lost, {samples.invalid} invalid, {gaps}"
    if samples.missing_blocks:
        text += f", {samples.missing_blocks} blocks missing"
    return f"{text}; {info.bytes_per_sample:.2f} bytes per sample with everything else in the file"


def _swing(info: RecordingInfo) -> str:
    swing = info.largest_swing
    if swing is None:
        return "none reported"
    uncertainty = "uncertainty unknown" if swing.u_deg is None else f"u {swing.u_deg:.3f} deg"
    return f"{swing.phi_max_deg:.3f} deg ({uncertainty}) at {utc_text(swing.time_ns)}"


def _topic_lines(info: RecordingInfo) -> Iterator[str]:
    width = max(len(topic.topic) for topic in info.topics)
    for topic in info.topics:
        rate = "" if topic.rate_hz is None else f"{topic.rate_hz:10.3f} Hz"
        yield f"{topic.topic:<{width}}{topic.count:>10}{rate}  {topic.schema}"


def _alert_lines(info: RecordingInfo) -> Iterator[str]:
    yield ""
    yield f"alerts: {len(info.alerts)}"
    for alert in info.alerts[:MOST_ALERTS]:
        yield f"  {utc_text(alert.time_ns)}  {alert.event:<8}{alert.level:<8}{alert.text}"
    if len(info.alerts) > MOST_ALERTS:
        yield f"  and {len(info.alerts) - MOST_ALERTS} more; --json has all of them"
