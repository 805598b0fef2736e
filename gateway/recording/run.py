"""The raw samples of a recording, with everything that is needed to compute its results again."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.errors import RecordingError
from devices.recording import Recording, longest_increasing_mask, missing_before
from devices.saturation import GYRO_END_OF_RANGE, angular_rates
from gateway import messages
from gateway.packing import unpack
from gateway.recording import header as names
from gateway.recording.mcap_salvage import SalvageReport
from gateway.recording.reader import RecordingFile, open_recording


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
    blocks: tuple[SampleBlock, ...]
    """The blocks as the device delivered them: times in gateway time, readings in `device.unit`."""
    configuration_toml: str | None
    calibrations: tuple[CalibrationInForce, ...]
    """The calibration in force at the start, and each later one."""
    losses: SalvageReport
    wall_offset_ns: int = 0
    """UTC of the wall clock minus gateway time, by the last message of the clock."""

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Gateway time of every sample, shape (n,)."""
        return np.concatenate([block.time_ns for block in self.blocks])

    def recording(self, origin_ns: int | None = None) -> Recording:
        """Return all samples as one recording, for `measure`; times count from `origin_ns`, or from the first sample.

        Samples with a repeated or backward time are left out and counted. Raises `RecordingError` for fewer than two samples.
        """
        time_ns = self.time_ns
        raw = np.concatenate([block.raw for block in self.blocks]).astype(np.float64)
        kept = longest_increasing_mask(time_ns)
        if kept.sum() < 2:
            raise RecordingError(f"{self.path}: has a single sample; choose a longer recording")
        repeated = np.isin(time_ns[~kept], time_ns[kept])
        origin_ns = int(time_ns[0]) if origin_ns is None else origin_ns
        time_s = (time_ns[kept] - origin_ns) / 1e9
        known_lost = self._before([block.lost for block in self.blocks])[kept]
        return Recording(
            time_s=time_s,
            raw=raw[kept],
            unit=self.device.unit,
            lost_before=np.maximum(known_lost, missing_before(time_s)),
            unusable_before=self._before([block.invalid for block in self.blocks])[kept],
            temperature_c=self._temperature_c()[kept],
            gyro_dps=None if (gyro_dps := self._gyro_dps()) is None else gyro_dps[kept],
            saturated=None if (saturated := self._saturated()) is None else saturated[kept],
            repeated=int(repeated.sum()),
            backward=int((~repeated).sum()),
            invalid=sum(block.invalid for block in self.blocks),
            origin_ns=origin_ns,
        )

    def _before(self, counts: list[int]) -> NDArray[np.int64]:
        """Return a count of each block at its first sample, zero at the others, shape (n,)."""
        lengths = np.array([len(block) for block in self.blocks])
        spread = np.zeros(lengths.sum(), dtype=np.int64)
        spread[np.cumsum(lengths) - lengths] = counts
        return spread

    def _gyro_dps(self) -> NDArray[np.float64] | None:
        """Return the angular rates in the sensor's axes, shape (n, 3), NaN where a block has none; None without a gyroscope."""
        scale = self.device.gyro_rad_s_per_count
        if scale is None or all(block.gyro_counts is None for block in self.blocks):
            return None
        none = np.zeros((1, 3), dtype=np.int32) + GYRO_END_OF_RANGE
        counts = [
            np.repeat(none, len(block), axis=0) if block.gyro_counts is None else block.gyro_counts
            for block in self.blocks
        ]
        return np.degrees(angular_rates(np.concatenate(counts), scale))

    def _saturated(self) -> NDArray[np.bool_] | None:
        """Return the saturated samples, shape (n,); None where a block does not mark them."""
        marks = [block.saturated for block in self.blocks if block.saturated is not None]
        return np.concatenate(marks) if len(marks) == len(self.blocks) else None

    def _temperature_c(self) -> NDArray[np.float64]:
        known = [np.nan if block.temperature_c is None else block.temperature_c for block in self.blocks]
        return np.repeat(np.array(known, dtype=np.float64), [len(block) for block in self.blocks])


def read_samples(path: Path | str) -> RecordedRun:
    """Read a recording of the gateway. Raises `RecordingError` where it has no samples or no description of the device."""
    file = open_recording(path)
    blocks: list[SampleBlock] = []
    calibrations: list[CalibrationInForce] = []
    units: set[str] = set()
    wall_offset_ns = 0
    for recorded in file.messages():
        content = file.decode(recorded)
        if isinstance(content, messages.Samples):
            _add_block(file, blocks, content)
            units.add(content.unit)
        elif isinstance(content, messages.Calibration):
            calibrations.append(CalibrationInForce(recorded.log_time_ns, content))
        elif isinstance(content, messages.ClockOffset):
            wall_offset_ns = content.wall_offset_ns
    if not blocks:
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
        blocks=tuple(blocks),
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


def _add_block(file: RecordingFile, blocks: list[SampleBlock], samples: messages.Samples) -> None:
    try:
        blocks.append(unpack(samples))
    except ValueError:
        file.losses.unreadable_messages += 1


def _content(calibration: CalibrationInForce) -> tuple[object, ...]:
    message = calibration.message
    return message.calibration_id, message.status, message.record, message.in_force


def _missing_samples_error(file: RecordingFile) -> RecordingError:
    topics = sorted({channel.topic for channel in file.channels.values()})
    if "/samples" in topics or names.ORIGIN in file.metadata:
        return NoSamplesError(
            f"{file.path}: has no samples; the gateway was stopped or lost its device before the first one"
        )
    found = ", ".join(topics[:12]) or "none"
    return RecordingError(
        f"{file.path}: has no topic /samples, which a recording of the gateway has; its topics: {found}"
    )
