"""A recording, from any supported file, as specific force in the housing frame."""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import SAME_AXES, map_axes
from devices.recording import Recording
from devices.tables.foreign import NOTHING_STATED, TableOptions, is_native
from devices.tables.native import read_table
from gateway.calibration.correction import Correction, widest
from gateway.configuration.model import ALIGNED_MOUNT_U_DEG
from gateway.errors import InputError
from gateway.measurement.foreign_file import read_foreign
from gateway.measurement.recording_files import common_configuration, corrections_in_force
from gateway.motion.gyro_reading import GyroPrior
from gateway.numerics.foreign_readings import find_dropouts, find_fresh_rows, saturation_level
from gateway.pipeline.force_stage import TemperatureFilter, find_clipped
from gateway.pipeline.motion_stage import device_gyro, gyro_prior
from gateway.pipeline.rig import CALIBRATED, UNCALIBRATED, DefaultUncertainty, Rig, configured_housing, with_sensor
from gateway.recording.reading.interval import WHOLE_RECORDING, RecordingExtent, RecordingInterval
from gateway.recording.reading.samples import RecordedSamples, read_samples
from gateway.recording.reading.timeline import list_recordings
from gateway.swing.rig import MountedHousing

UNCALIBRATED_NORM_ERROR_G = 0.05
"""Largest error of the norm of an uncalibrated sensor of a phone or radio board at rest. Basis: a choice; data sheets state
offsets of 0.02 to 0.08 g."""
LONGEST_END_S = 1.0
"""Time without a sample at an end of an interval that is worth a remark. Basis: a choice; blocks of samples are shorter."""
TURNED_RAD = math.radians(60.0)
"""Angle of the specific force to the housing's z axis beyond which the housing does not hang on the rope. Basis: five of the six
poses of a recalibration are at 90° and more, and no load swings so far."""
REMOUNTING_S = 60.0
"""Time behind a recalibration in which the housing may be turned still. Basis: a choice; a clamp is closed within a minute."""
UNALIGNED_MOUNT_U_DEG = 0.57
"""Standard uncertainty of the angle between sensor and rope where nobody has zeroed it: fixed by eye, within one degree. Basis:
within one degree, uniformly distributed."""


@dataclass(frozen=True, slots=True)
class HeldRows:
    """The rows of a file in which a sensor repeats its readings."""

    time_s: NDArray[np.float64]
    """Times of all n rows, shape (n,)."""
    reading: NDArray[np.int64]
    """The reading that each row holds, counted from 0, shape (n,)."""

    def part(self, start: int, stop: int) -> "HeldRows":
        """Return the rows of the readings from `start` until before `stop`."""
        kept = (self.reading >= start) & (self.reading < stop)
        return HeldRows(self.time_s[kept], self.reading[kept] - start)


@dataclass(frozen=True, slots=True)
class Source:
    """The input of `measure`: specific force, with what is known of sensor and housing."""

    files: tuple[Path, ...]
    """In order of time."""
    recording: Recording
    """The samples of the interval, on the time axis of the whole recording."""
    extent: RecordingExtent
    """First and last sample of the whole recording."""
    force_g: NDArray[np.float64]
    """Specific force in the housing frame, shape (n, 3)."""
    permissible_norm_error_g: float
    calibration: str
    noise_g: float | NDArray[np.float64] | None = None
    full_scale_g: float | None = None
    housing: MountedHousing | None = None
    """From the rig, or from the configuration in the recording; None: the position is not known."""
    correction: Correction | None = None
    """Correction applied to the readings, its uncertainty widened for the recording's temperatures, of several the largest; None:
    none was applied."""
    bandwidth_hz: float | None = None
    """Bandwidth of the low-pass inside the sensor."""
    rate_rad_s: NDArray[np.float64] | None = None
    """Angular rates in the housing frame, shape (n, 3), NaN where a sample has none; None without a gyroscope."""
    gyro: GyroPrior | None = None
    """What is known of the gyroscope; None: there is none."""
    is_planar: bool = False
    """The table states two axes, in whose plane the load swings; y is zero."""
    repeated_readings: int = 0
    """Rows left out because the sensor repeats its reading until it has a new one."""
    held_rows: HeldRows | None = None
    """The rows before that; None where no reading is repeated."""
    limits: DefaultUncertainty = CALIBRATED
    """What is known of the sensor's errors where neither a calibration nor the rig says it."""
    mount_u_deg: float = ALIGNED_MOUNT_U_DEG
    """Standard uncertainty of the angle between the housing's z axis and the rope, as configured."""
    temperature_warnings: tuple[str, ...] = ()
    """Temperatures outside those of the calibration, which widen the uncertainty."""
    remarks: tuple[str, ...] = ()
    """Incomplete files, gaps between files, limits outside the recording, a change of calibration."""

    @property
    def mount_u_rad(self) -> float:
        """Standard uncertainty of the angle between the sensor's z axis and the rope."""
        cross_axis_u = 0.0 if self.correction is None else self.correction.u_cross_axis
        return math.hypot(math.radians(self.mount_u_deg), cross_axis_u)

    def find_clipped(self) -> NDArray[np.bool_]:
        """Return the clipped samples, shape (n,): as the device marks them, or those at full scale.

        Where neither is known, they are those at a limit that occurs too often for a motion.
        """
        if self.full_scale_g is not None or self.recording.saturated is not None:
            return find_clipped(self.force_g, self.recording.saturated, self.full_scale_g)
        levels_g = [saturation_level(values) for values in self.force_g.T]
        limits_g = [np.inf if level_g is None else abs(level_g) for level_g in levels_g]
        return np.asarray((np.abs(self.force_g) >= limits_g).any(axis=1), dtype=np.bool_)

    def keeping(self, kept: slice | NDArray[np.bool_], recording: Recording, remark: str, **changes: Any) -> "Source":
        """Return a part of the samples, which is this recording, with a remark on what was left out and other changes."""
        return replace(
            self,
            recording=recording,
            force_g=self.force_g[kept],
            rate_rad_s=None if self.rate_rad_s is None else self.rate_rad_s[kept],
            remarks=(*self.remarks, remark),
            **changes,
        )

    @property
    def name(self) -> str:
        """The file, or the number of files with the first and the last."""
        first, last = self.files[0], self.files[-1]
        return str(first) if len(self.files) == 1 else f"{len(self.files)} files, {first} to {last.name}"


def read_source(
    paths: Sequence[Path],
    rig: Rig | None = None,
    interval: RecordingInterval = WHOLE_RECORDING,
    options: TableOptions = NOTHING_STATED,
) -> Source:
    """Read a table, or the `.mcap` files of one gateway as one recording; values of a rig replace those of the recording.

    A folder stands for its `.mcap` files. `options` describe a table of another program. Raises `RecordingError` or `InputError`
    with the place and the remedy.
    """
    files = list_recordings(paths)
    if len(files) > 1 and (other := next((file for file in files if file.suffix != ".mcap"), None)) is not None:
        raise InputError(f"{other}: cannot be joined with other files; only .mcap files of one gateway can")
    if files[0].suffix != ".mcap":
        source = _from_table(files[0], interval, options)
    elif options != NOTHING_STATED:
        raise InputError(
            f"{files[0]}: states its own columns and units; leave --columns, --unit, --time, --axes, --rate out"
        )
    else:
        source = _from_run(files, rig, interval)
    source = _without_repeated_readings(_without_dropouts(source))
    if rig is None:
        return source
    sensor = rig.sensor
    stated = np.array(sensor.noise_g) if isinstance(sensor.noise_g, list) else sensor.noise_g
    return replace(
        source,
        force_g=rig.correct(source.force_g),
        rate_rad_s=None if source.rate_rad_s is None else rig.turn(source.rate_rad_s),
        mount_u_deg=source.mount_u_deg if rig.housing.mount_u_deg is None else rig.housing.mount_u_deg,
        housing=_mounted_housing(rig, source),
        noise_g=source.noise_g if stated is None else stated,
        full_scale_g=sensor.full_scale_g or source.full_scale_g,
    )


def _without_dropouts(source: Source) -> Source:
    """Return the source without rows of zeros, which a logger writes where it has no reading."""
    missing = find_dropouts(source.recording.raw)
    if not missing.any():
        return source
    remark = (
        f"found: {int(missing.sum())} rows are zero in all axes though the rows around them are not; they are left out"
    )
    return source.keeping(~missing, source.recording.without_invalid(missing), remark)


def _without_repeated_readings(source: Source) -> Source:
    """Return the source with each reading once, where the sensor is slower than its file."""
    recording = source.recording
    fresh = find_fresh_rows(recording.raw)
    if fresh is None:
        return source
    found = recording.without_repeats(fresh)
    remark = (
        f"found: the sensor is slower than its file: {found.rate_hz:.4g} readings per second in {recording.rate_hz:.4g} rows; "
        f"{len(recording) - len(found)} repeated rows left out, each reading has the time of its first row"
    )
    return source.keeping(
        fresh,
        found,
        remark,
        repeated_readings=len(recording) - len(found),
        held_rows=HeldRows(recording.time_s, np.cumsum(fresh) - 1),
    )


def _mounted_housing(rig: Rig, source: Source) -> MountedHousing:
    """Return the housing at the position of the rig, with the uncertainties of the sensor's calibration where it has one."""
    housing, bandwidth_hz = rig.mounted_housing(source.limits), rig.sensor.bandwidth_hz or source.bandwidth_hz
    if source.correction is None:
        return replace(housing, bandwidth_hz=bandwidth_hz)
    aligned = replace(housing, mount_u_rad=housing.mount_u_rad or 0.0)  # a gateway zeroes the mount
    return with_sensor(aligned, source.correction, bandwidth_hz)


def _from_table(path: Path, interval: RecordingInterval, options: TableOptions) -> Source:
    if path.suffix.lower() != ".mat" and options == NOTHING_STATED and is_native(path):
        return _table_source(path, read_table(path), interval, "as recorded", ())
    whole, findings = read_foreign(path, options)
    source = _table_source(path, whole, interval, "not known: a recording of another program", findings)
    return replace(
        source,
        permissible_norm_error_g=UNCALIBRATED_NORM_ERROR_G,
        limits=UNCALIBRATED,
        is_planar=options.is_planar,
        mount_u_deg=UNALIGNED_MOUNT_U_DEG,
    )


def _table_source(
    path: Path, whole: Recording, interval: RecordingInterval, calibration: str, findings: tuple[str, ...]
) -> Source:
    extent = _extent(whole, 0)
    recording = _cut(whole, interval, extent)
    return Source(
        files=(path,),
        recording=recording,
        extent=extent,
        force_g=recording.raw,
        permissible_norm_error_g=0.01,
        calibration=calibration,
        rate_rad_s=None if recording.gyro_dps is None else np.radians(recording.gyro_dps),
        gyro=None if recording.gyro_dps is None else gyro_prior(),
        remarks=(*(f"found: {finding}" for finding in findings), *interval.describe_excess(extent)),
    )


def _from_run(files: Sequence[Path], rig: Rig | None, interval: RecordingInterval) -> Source:
    run = read_samples(files, interval)
    configuration = common_configuration(run.files, same_rig=rig is None)
    whole = run.recording()
    extent = _extent(whole, run.wall_offset_ns) if run.span is None else run.span.extent
    recording = _cut(whole, interval, extent)
    axes = SAME_AXES if configuration is None else configuration.device.axes
    parts = corrections_in_force(run, recording, axes)
    temperature_c = _filtered_temperature_c(run, recording)
    extremes_c = [_extreme_temperature_c(recording, *part) for part in parts]
    widened = widest([each.widened_by(each.kelvin_beyond(c)) for (_, each), c in zip(parts, extremes_c, strict=True)])
    warnings = [each.range_warnings(c) for (_, each), c in zip(parts, extremes_c, strict=True)]
    bandwidth_hz = run.device.bandwidth_hz
    source = Source(
        files=tuple(each.path for each in run.files),
        recording=recording,
        extent=extent,
        force_g=np.concatenate([each.apply(recording.raw[part], temperature_c[part]) for part, each in parts]),
        permissible_norm_error_g=widened.permissible_norm_error_g,
        calibration=widened.text,
        noise_g=run.device.noise_g,
        full_scale_g=run.device.full_scale_g,
        housing=None if configuration is None else configured_housing(configuration, widened, bandwidth_hz),
        correction=widened,
        bandwidth_hz=bandwidth_hz,
        rate_rad_s=None if recording.gyro_dps is None else np.radians(map_axes(recording.gyro_dps, axes)),
        gyro=None if recording.gyro_dps is None else device_gyro(run.device),
        mount_u_deg=ALIGNED_MOUNT_U_DEG if configuration is None else configuration.housing.mount_u_deg,
        temperature_warnings=tuple(dict.fromkeys(chain.from_iterable(warnings))),
        remarks=(
            *run.remarks,
            *interval.describe_excess(extent),
            *_describe_ends(recording, interval, extent),
            *(
                f"another calibration came into force at {recording.time_s[part.start]:.3f} s; each part is judged by its own"
                for part, _ in parts[1:]
            ),
        ),
    )
    return _without_suspended(source, run)


def _describe_ends(recording: Recording, interval: RecordingInterval, extent: RecordingExtent) -> Iterator[str]:
    """Yield a remark for each end of the interval at which the recording has no samples, though it has others beyond."""
    begin_s, end_s = interval.limits_s(extent)
    first_s, last_s = float(recording.time_s[0]), float(recording.time_s[-1])
    for from_s, to_s in ((max(begin_s, extent.first_s), first_s), (last_s, min(end_s, extent.last_s))):
        if to_s - from_s > LONGEST_END_S:
            ends = f"{from_s - extent.first_s:.1f} to {to_s - extent.first_s:.1f} s"
            yield f"{ends}: no samples, or none that can be read; `plumbline record info` and `verify` say why"


def _without_suspended(source: Source, run: RecordedSamples) -> Source:
    """Return the source without what the sensor read while somebody recalibrated it, and it did not hang on the rope.

    Raises `InputError` where too little is left.
    """
    origin_ns = source.recording.origin_ns or 0
    for (begin_ns, by), (end_ns, _) in pairwise((*run.suspensions, (sys.maxsize, ""))):
        time_s, first_s = source.recording.time_s, source.extent.first_s
        begin_s = (begin_ns - origin_ns) / 1e9
        end_s = _remounted_s(source, (end_ns - origin_ns) / 1e9)
        inside = (time_s >= begin_s) & (time_s < end_s) & bool(by)
        if not inside.any():
            continue
        until = "on" if end_ns == sys.maxsize else f"to {end_s - first_s:.1f} s"
        text = f"from {begin_s - first_s:.1f} s {until} the sensor was being recalibrated by {by}"
        if (~inside).sum() < 2:
            raise InputError(f"{text}, and no reading describes the load; choose another time")
        source = source.keeping(~inside, source.recording.without_invalid(inside), f"{text}; not judged")
    return source


def _remounted_s(source: Source, end_s: float) -> float:
    """Return when the housing hangs on the rope again after a recalibration, which may have ended in a pose."""
    first, last = np.searchsorted(source.recording.time_s, [end_s, end_s + REMOUNTING_S])
    force_g = source.force_g[first:last]
    turned = np.flatnonzero(np.arctan2(np.hypot(force_g[:, 0], force_g[:, 1]), force_g[:, 2]) > TURNED_RAD)
    return end_s if len(turned) == 0 else math.nextafter(source.recording.time_s[first + turned[-1]], math.inf)


def _filtered_temperature_c(run: RecordedSamples, recording: Recording) -> NDArray[np.float64]:
    """Return the temperature of each sample as the gateway filters it, shape (n,), NaN before the first one."""
    thermometer, end_ns = TemperatureFilter(), run.samples.end_ns
    blocks = zip(end_ns.tolist(), run.samples.temperature_c.tolist(), strict=True)
    filtered_c = np.array([thermometer.update(time_ns, None if math.isnan(c) else c) for time_ns, c in blocks])
    sample_ns = (recording.origin_ns or 0) + np.rint(recording.time_s * 1e9).astype(np.int64)
    place = np.minimum(np.searchsorted(end_ns, sample_ns), len(end_ns) - 1)
    return np.asarray(filtered_c[place], dtype=np.float64)


def _extent(recording: Recording, wall_offset_ns: int) -> RecordingExtent:
    origin_ns = None if recording.origin_ns is None else recording.origin_ns + wall_offset_ns
    return RecordingExtent(float(recording.time_s[0]), float(recording.time_s[-1]), origin_ns)


def _cut(recording: Recording, interval: RecordingInterval, extent: RecordingExtent) -> Recording:
    """Return the samples of the interval. Raises `InputError` where it has fewer than two."""
    begin_s, end_s = interval.limits_s(extent)
    start, stop = np.searchsorted(recording.time_s, [begin_s, end_s]).tolist()
    if stop - start < 2:
        raise InputError(f"the interval has fewer than two samples; the recording is {extent}")
    return recording.part(start, stop)


def _extreme_temperature_c(recording: Recording, part: slice, correction: Correction) -> float | None:
    """Return the temperature of a part of a recording that is farthest outside those of the calibration."""
    if recording.temperature_c is None or not np.isfinite(recording.temperature_c[part]).any():
        return None
    ends_c = float(np.nanmin(recording.temperature_c[part])), float(np.nanmax(recording.temperature_c[part]))
    return max(ends_c, key=correction.kelvin_beyond)
