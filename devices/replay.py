"""A recording that is played back as a device, in real time or faster."""

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import EndOfRecording
from devices.errors import RecordingError
from devices.recording import Recording, typical_interval

LONGEST_WAIT_S = 0.5
GYRO_DPS_PER_COUNT = 1e-2
"""Resolution of the angular rates of a text recording: a fraction of the noise of any such gyroscope."""


class Replay:
    """Plays a recording from its start at each `open`.

    Sample times keep the recorded spacing at any speed. They begin at the gateway time of `open`, or are the recorded times if
    the recording is absolute. Played faster than real time, they run ahead of the clock.
    """

    def __init__(
        self, recording: Recording, info: DeviceInfo, *, clock: Clock, speed: float = 1.0, block_samples: int = 32
    ) -> None:
        """`speed`: recorded seconds per second; 1 is real time, 0 or inf as fast as possible. Raises `ValueError`."""
        if not speed >= 0:
            raise ValueError(
                f"speed {speed} of a replay is impossible: give 1 for real time, 0 for as fast as possible"
            )
        if block_samples < 1:
            raise ValueError(f"blocks of {block_samples} samples are impossible: give at least 1")
        self.recording = recording
        self.info = info
        self._clock = clock
        self._seconds_per_recorded = 0.0 if speed in (0, math.inf) else 1 / speed
        self._block_samples = block_samples
        self._offset_ns = recording.offset_ns()
        self._breaks = _breaks(recording)
        self._raw = np.rint(recording.raw).astype(np.int32) if info.unit == "counts" else recording.raw
        self._gyro_counts = _gyro_counts(recording, info)
        self._start_ns = 0
        self._first_ns = 0
        self._next = len(recording)

    def open(self) -> DeviceInfo:
        """Return to the start of the recording."""
        self._start_ns = self._clock.now_ns()
        self._first_ns = self._start_ns
        if self.recording.origin_ns is not None:
            self._first_ns = self.recording.origin_ns + round(float(self.recording.time_s[0]) * 1e9)
        self._next = 0
        return self.info

    def read(self) -> SampleBlock | None:
        """Return the next block when its last sample is due; None if that is more than half a second away."""
        first, end = self._next, self._block_end()
        due_ns = self._start_ns + round(int(self._offset_ns[end - 1]) * self._seconds_per_recorded)
        wait_s = (due_ns - self._clock.now_ns()) / 1e9
        if self._seconds_per_recorded and wait_s > 0:
            self._clock.sleep_s(min(wait_s, LONGEST_WAIT_S))
            if wait_s > LONGEST_WAIT_S:
                return None
        self._next = end
        return SampleBlock(
            time_ns=self._first_ns + self._offset_ns[first:end],
            raw=self._raw[first:end],
            temperature_c=self._temperature_c(first, end),
            lost=int(self.recording.lost_before[first]),
            invalid=int(self.recording.unusable_before[first:end].sum()),
            gyro_counts=None if self._gyro_counts is None else self._gyro_counts[first:end],
            saturated=None if self.recording.saturated is None else self.recording.saturated[first:end],
        )

    def close(self) -> None:
        """Nothing to release."""
        self._next = len(self.recording)

    @property
    def faults(self) -> Mapping[str, int]:
        """The rows that were left out of the whole recording, by kind; the blocks state the gaps."""
        recording = self.recording
        return {
            "repeated": recording.repeated,
            "backward": recording.backward,
            "invalid": recording.invalid,
            "blank": recording.blank,
            "truncated": recording.truncated,
        }

    def _block_end(self) -> int:
        """Return the end of the block that begins at `_next`; a gap is always between two blocks."""
        if self._next == len(self.recording):
            raise EndOfRecording(f"{self.info.device_id}: played to its end")
        following = np.searchsorted(self._breaks, self._next, side="right")
        until = int(self._breaks[following]) if following < len(self._breaks) else len(self.recording)
        return min(self._next + self._block_samples, until)

    def _temperature_c(self, first: int, end: int) -> float | None:
        if self.recording.temperature_c is None:
            return None
        known = self.recording.temperature_c[first:end]
        known = known[np.isfinite(known)]
        return float(known.mean()) if len(known) else None


def table_info(
    path: Path, recording: Recording, *, units_per_g: float | None = None, housing_frame: bool = False
) -> DeviceInfo:
    """Return the description of the device that made a text recording.

    `units_per_g` is the sensitivity of counts; `housing_frame`: the readings are calibrated specific force in the housing frame.
    Raises `RecordingError`.
    """
    if recording.unit == "counts" and units_per_g is None:
        raise RecordingError(f"{path}: is in counts and its sensitivity is not given; say how many counts are 1 g")
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return DeviceInfo(
        kind="replay",
        device_id=f"recording-{path.stem}-{digest[:8]}",
        unit=recording.unit,
        odr_hz=float(f"{recording.rate_hz:.6g}"),
        units_per_g=units_per_g if recording.unit == "counts" and units_per_g else 1.0,
        gyro_rad_s_per_count=None if recording.gyro_dps is None else math.radians(GYRO_DPS_PER_COUNT),
        calibrated_source=housing_frame,
        can_wait=True,
        details={"file": path.name, "sha256": digest},
    )


def _gyro_counts(recording: Recording, info: DeviceInfo) -> NDArray[np.int32] | None:
    """Return the angular rates in counts, shape (n, 3); a row without them gets a count beyond any range."""
    if recording.gyro_dps is None or info.gyro_rad_s_per_count is None:
        return None
    counts = np.radians(recording.gyro_dps) / info.gyro_rad_s_per_count
    beyond = np.iinfo(np.int16).max
    return np.rint(np.where(np.isfinite(counts), np.clip(counts, -beyond, beyond), beyond)).astype(np.int32)


def _breaks(recording: Recording) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the indices at which a block must begin: after each gap."""
    late = np.diff(recording.time_s, prepend=recording.time_s[0]) > 1.5 * typical_interval(recording.time_s)
    return np.flatnonzero(late | (recording.lost_before > 0))
