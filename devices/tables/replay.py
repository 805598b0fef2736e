"""A recording that is played back as a device, in real time or faster."""

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.clock import Clock
from devices.device import MAX_READ_S, EndOfRecording
from devices.errors import RecordingError
from devices.recording import Recording, typical_interval

ROW_FAULTS = ("repeated", "backward", "invalid", "blank", "truncated")
"""The kinds of rows that a recording counts."""
GYRO_DPS_PER_COUNT = 1e-2
"""Resolution of the angular rates of a text recording. Basis: a fraction of the noise of any such gyroscope."""


class Replay:
    """Plays a recording from its start at each `open`, part by part, so that it takes the memory of one part.

    Sample times keep the recorded spacing at any speed. They begin at the gateway time of `open`, or are the recorded times if
    the recording is absolute. Played faster than real time, they run ahead of the clock.
    """

    def __init__(
        self, parts: Iterable[Recording], info: DeviceInfo, *, clock: Clock, speed: float = 1.0, block_samples: int = 32
    ) -> None:
        """`parts`: recordings on one time axis, at least one, which follow each other and are iterated over at each `open`.

        `speed`: recorded seconds per second; 1 is real time, 0 or inf as fast as possible. Raises `ValueError`.
        """
        if not speed >= 0:
            raise ValueError(
                f"speed {speed} of a replay is impossible: give 1 for real time, 0 for as fast as possible"
            )
        if block_samples < 1:
            raise ValueError(f"blocks of {block_samples} samples are impossible: give at least 1")
        self.info = info
        self._parts = parts
        self._clock = clock
        self._seconds_per_recorded = 0.0 if speed in (0, math.inf) else 1 / speed
        self._block_samples = block_samples
        self._following: Iterator[Recording] = iter(())
        self._window: _Window | None = None
        """The samples that are played next; None: closed, or at the end."""
        self._next = 0
        self._start_ns = 0
        self._first_ns = 0
        self._axis_begin_s = 0.0
        """Time of the first sample on the axis of the recording."""
        self._opened_parts = self._counted_parts = 0
        self._faults = dict.fromkeys(ROW_FAULTS, 0)

    def open(self) -> DeviceInfo:
        """Return to the start of the recording."""
        self._following, self._opened_parts = iter(self._parts), 0
        self._start_ns = self._first_ns = self._clock.now_ns()
        self._window, self._next = None, 0
        first = self._next_part()
        if first is not None:
            if first.origin_ns is not None:
                self._first_ns = first.origin_ns + round(float(first.time_s[0]) * 1e9)
            self._axis_begin_s = float(first.time_s[0])
            self._window = self._window_of(first)
        return self.info

    def read(self) -> SampleBlock | None:
        """Return the next block when its last sample is due; None if that is more than half a second away."""
        window, first, end = self._next_block()
        due_ns = self._start_ns + round(int(window.time_ns[end - 1] - self._first_ns) * self._seconds_per_recorded)
        wait_s = (due_ns - self._clock.now_ns()) / 1e9
        if self._seconds_per_recorded and wait_s > 0:
            self._clock.sleep_s(min(wait_s, MAX_READ_S))
            if wait_s > MAX_READ_S:
                return None
        self._next = end
        return window.block(first, end)

    def close(self) -> None:
        """Release the recording."""
        self._window, self._following = None, iter(())

    @property
    def faults(self) -> Mapping[str, int]:
        """The rows that were left out of the parts that were read, by kind; the blocks state the gaps."""
        return self._faults

    def _next_block(self) -> tuple["_Window", int, int]:
        """Return the samples in memory, with begin and end of the next block; a gap is always between two blocks."""
        window = self._window
        while window is not None and len(window.time_ns) - self._next < self._block_samples:
            if (part := self._next_part()) is None:
                break
            window = self._window = self._window_of(window.recording.continued_by(part, self._next))
            self._next = 0
        if window is None or self._next == len(window.time_ns):
            raise EndOfRecording(f"{self.info.device_id}: played to its end")
        following = np.searchsorted(window.breaks, self._next, side="right")
        until = int(window.breaks[following]) if following < len(window.breaks) else len(window.time_ns)
        return window, self._next, min(self._next + self._block_samples, until)

    def _next_part(self) -> Recording | None:
        part = next(self._following, None)
        if part is not None:
            self._opened_parts += 1
            if self._opened_parts > self._counted_parts:
                self._counted_parts = self._opened_parts
                for name in ROW_FAULTS:
                    self._faults[name] += getattr(part, name)
        return part

    def _window_of(self, recording: Recording) -> "_Window":
        offset_ns = np.rint((recording.time_s - self._axis_begin_s) * 1e9).astype(np.int64)
        return _Window(
            recording=recording,
            time_ns=self._first_ns + offset_ns,
            raw=np.rint(recording.raw).astype(np.int32) if self.info.unit == "counts" else recording.raw,
            gyro_counts=_gyro_counts(recording, self.info),
            breaks=_breaks(recording),
        )


@dataclass(frozen=True, slots=True)
class _Window:
    """The samples of a replay in memory, as a device delivers them."""

    recording: Recording
    time_ns: NDArray[np.int64]
    raw: NDArray[np.int32] | NDArray[np.float64]
    gyro_counts: NDArray[np.int32] | None
    breaks: NDArray[np.int64]
    """Indices at which a block must begin."""

    def block(self, first: int, end: int) -> SampleBlock:
        """Return the samples from index `first` until before `end`."""
        recording = self.recording
        return SampleBlock(
            time_ns=self.time_ns[first:end],
            raw=self.raw[first:end],
            temperature_c=self._temperature_c(first, end),
            lost=int(recording.lost_before[first]),
            invalid=int(recording.unusable_before[first:end].sum()),
            gyro_counts=None if self.gyro_counts is None else self.gyro_counts[first:end],
            saturated=None if recording.saturated is None else recording.saturated[first:end],
        )

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
