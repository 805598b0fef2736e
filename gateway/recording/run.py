"""The raw samples of a recording, with everything that is needed to compute its results again."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo
from devices.errors import RecordingError
from devices.recording import Recording, longest_increasing_mask, missing_before
from devices.saturation import angular_rates
from gateway import messages
from gateway.packing import unpack
from gateway.recording import header as names
from gateway.recording.mcap_salvage import SalvageReport
from gateway.recording.reader import RecordingFile, Selection, open_recording
from gateway.recording.sample_columns import ColumnBuilder, SampleColumns

SAMPLES = "/samples"
NEEDED_TOPICS = frozenset({SAMPLES, "/calibration", "/clock"})


class NoSamplesError(RecordingError):
    """A recording of the gateway has ended, or is read, before its first sample."""


@dataclass(frozen=True, slots=True)
class CalibrationInForce:
    """A calibration in force, and the gateway time of its first message."""

    log_time_ns: int
    message: messages.Calibration


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The samples of one recording with their device, configuration and calibrations."""

    path: Path
    origin: dict[str, str]
    """Software, site, crane, sensor and boot id of the gateway; empty where another program wrote the file."""
    device: DeviceInfo
    samples: SampleColumns
    """The samples as the device delivered them: times in gateway time, readings in `device.unit`."""
    configuration_toml: str | None
    calibrations: tuple[CalibrationInForce, ...]
    """The calibration in force at the start, and each later one."""
    losses: SalvageReport
    wall_offset_ns: int = 0
    """UTC of the wall clock minus gateway time, by the last message of the clock."""

    def recording(self, origin_ns: int | None = None) -> Recording:
        """Return all samples as one recording, for `measure`; times count from `origin_ns`, or from the first sample.

        Samples with a repeated or backward time are left out and counted. Raises `RecordingError` for fewer than two samples.
        """
        samples = self.samples
        mask = longest_increasing_mask(samples.time_ns)
        if mask.sum() < 2:
            raise RecordingError(f"{self.path}: has a single sample; choose a longer recording")
        kept: slice | NDArray[np.bool_] = slice(None) if mask.all() else mask  # a slice copies nothing
        repeated = np.isin(samples.time_ns[~mask], samples.time_ns[mask])
        origin_ns = int(samples.time_ns[0]) if origin_ns is None else origin_ns
        time_s = (samples.time_ns[kept] - origin_ns) / 1e9
        lost_before = samples.at_first_sample(samples.lost)[kept]
        scale, rates = self.device.gyro_rad_s_per_count, samples.gyro_counts
        return Recording(
            time_s=time_s,
            raw=samples.raw[kept].astype(np.float64),
            unit=self.device.unit,
            lost_before=np.maximum(lost_before, missing_before(time_s), out=lost_before),
            unusable_before=samples.at_first_sample(samples.invalid)[kept],
            temperature_c=np.repeat(samples.temperature_c, samples.length)[kept],
            gyro_dps=None if scale is None or rates is None else np.degrees(angular_rates(rates[kept], scale)),
            saturated=None if samples.saturated is None else samples.saturated[kept],
            repeated=int(repeated.sum()),
            backward=int((~repeated).sum()),
            invalid=int(samples.invalid.sum()),
            origin_ns=origin_ns,
        )


def read_samples(path: Path | str, begin_ns: int | None = None, end_ns: int | None = None) -> RecordedRun:
    """Read a recording of the gateway; with `begin_ns` and `end_ns`, only the blocks that end from one until before the other.

    Raises `RecordingError` where there are no samples or no description of the device.
    """
    file = open_recording(path)
    builder = ColumnBuilder()
    calibrations: list[CalibrationInForce] = []
    units: set[str] = set()
    wall_offset_ns = 0
    for recorded in file.messages(Selection(end_ns=end_ns, topics=NEEDED_TOPICS)):
        if begin_ns is not None and recorded.topic == SAMPLES and recorded.log_time_ns < begin_ns:
            continue  # the calibration and the clock before are needed
        content = file.decode(recorded)
        if isinstance(content, messages.Samples):
            _add_block(file, builder, content)
            units.add(content.unit)
        elif isinstance(content, messages.Calibration):
            calibrations.append(CalibrationInForce(recorded.log_time_ns, content))
        elif isinstance(content, messages.ClockOffset):
            wall_offset_ns = content.wall_offset_ns
    samples = builder.columns()
    if samples is None:
        raise _missing_samples_error(file)
    device = file.device()
    if units != {device.unit}:
        raise RecordingError(
            f"{file.path}: samples in {' and '.join(sorted(units))} from a device in {device.unit}; it cannot be replayed"
        )
    attachment = file.attachments.get(names.CONFIGURATION)
    return RecordedRun(
        path=file.path,
        origin=file.metadata.get(names.ORIGIN, {}),
        device=device,
        samples=samples,
        configuration_toml=None if attachment is None else attachment.data.decode(errors="replace"),
        calibrations=list_changes(calibrations),
        losses=file.losses,
        wall_offset_ns=wall_offset_ns,
    )


def list_changes(calibrations: Iterable[CalibrationInForce]) -> tuple[CalibrationInForce, ...]:
    """Return the calibrations without those that repeat the one before."""
    changes: list[CalibrationInForce] = []
    for calibration in calibrations:
        if not changes or _content(changes[-1]) != _content(calibration):
            changes.append(calibration)
    return tuple(changes)


def _add_block(file: RecordingFile, builder: ColumnBuilder, samples: messages.Samples) -> None:
    try:
        builder.add(unpack(samples))
    except ValueError:
        file.losses.unreadable_messages += 1


def _content(calibration: CalibrationInForce) -> tuple[object, ...]:
    message = calibration.message
    return message.calibration_id, message.status, message.record, message.in_force


def _missing_samples_error(file: RecordingFile) -> RecordingError:
    topics = sorted({channel.topic for channel in file.channels.values()})
    if SAMPLES in topics or names.ORIGIN in file.metadata:
        return NoSamplesError(
            f"{file.path}: has no samples; the gateway was stopped or lost its device before the first one"
        )
    found = ", ".join(topics[:12]) or "none"
    return RecordingError(
        f"{file.path}: has no topic /samples, which a recording of the gateway has; its topics: {found}"
    )
