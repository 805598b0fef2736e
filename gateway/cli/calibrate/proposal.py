"""A thermal model that a gateway offers of itself: learned at rest from its own recordings, stored, not put in force."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gateway import __version__
from gateway.bench.thermal.rest_calibration import learn_at_rest
from gateway.calibration.acceptance import judge, make_record
from gateway.calibration.correction import ZERO_G_OFFSET_LIMIT_G_PER_K
from gateway.calibration.input_files import FileReadings
from gateway.calibration.record import THERMAL_REST, CalibrationRecord, NotDeterminedError
from gateway.calibration.store import CalibrationStore
from gateway.measurement.recording_files import readings_of
from gateway.recording.reading.recording_file import SegmentIndex
from gateway.recording.reading.samples import read_samples
from gateway.recording.reading.timeline import ReportProgress, open_timeline
from gateway.units import HOURS_PER_DAY

USED_NS = round(7 * HOURS_PER_DAY * 3600 * 1e9)
"""Recordings of so long before the newest are used, ns. Basis: a choice; a week has several warmings, and a small board
reads it in minutes."""
PROPOSER = "plumbline"
"""Who made an offered record."""


def propose_thermal(data_dir: Path, created_utc: str, report: ReportProgress) -> CalibrationRecord:
    """Store the thermal model that finished recordings show, as an offer, and return its record.

    Raises `NotDeterminedError` where nothing is better than the record in force, or an offer was made; `RecordingError`,
    `CalibrationError` and `OSError` for files that cannot be used.
    """
    finished = [segment for segment in open_timeline([data_dir]).segments if segment.is_closed and not segment.is_empty]
    if not finished:
        raise NotDeterminedError(f"{data_dir}: no finished recording yet")
    device = read_samples([finished[-1].path]).device
    store = CalibrationStore(data_dir, device.device_id)
    parent = store.in_force()
    if parent is None or parent.thermal is not None:
        reason = "no record is in force" if parent is None else f"record {parent.id} has a thermal model"
        raise NotDeterminedError(f"{device.device_id}: {reason}")
    for record in map(store.record, store.ids()):
        if record.method == THERMAL_REST and record.parent == parent.id:
            raise NotDeterminedError(f"record {record.id} was offered already")
    newest = [segment for segment in finished if segment.to_ns >= finished[-1].to_ns - USED_NS]
    fit, found = learn_at_rest(_readings(newest, parent, report), parent)
    half_g_per_k = (found.ci95[1] - found.ci95[0]) / 2 / 1000
    limit_g_per_k = device.zero_g_offset_g_per_k or ZERO_G_OFFSET_LIMIT_G_PER_K
    if half_g_per_k >= limit_g_per_k:
        raise NotDeterminedError(
            f"{found.mg_per_c:+.3f} mg/°C ± {1000 * half_g_per_k:.3f} is known no better than by the data sheet, "
            f"± {1000 * limit_g_per_k:.3f}"
        )
    if refused := judge(fit, parent).refused:
        raise NotDeterminedError("; ".join(refused))
    record = make_record(
        fit, device_id=parent.device_id, unit=parent.unit, software=__version__, by=PROPOSER,
        created_utc=created_utc, parent=parent.id,
    )  # fmt: skip
    store.add(record)
    return record


def _readings(
    segments: Sequence[SegmentIndex], parent: CalibrationRecord, report: ReportProgress
) -> Iterator[FileReadings]:
    """Yield the readings of one segment after the other that has temperatures and in which the parent alone was in force."""
    for number, segment in enumerate(segments):
        report(number / len(segments))
        run = read_samples([segment.path])
        in_force = {each.message.calibration_id for each in run.calibrations}
        if in_force == {parent.id} and run.device.device_id == parent.device_id:
            readings = readings_of(run, segment.path)
            if readings.temperature_c is not None and not np.isnan(readings.temperature_c).all():
                yield readings
