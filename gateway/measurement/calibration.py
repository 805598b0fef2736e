"""The calibration that was in force during a recording."""

from devices.recording import Recording
from gateway.messages import Calibration
from gateway.recording.reading.samples import RecordedSamples


def calibration_in_force(run: RecordedSamples, recording: Recording) -> tuple[Calibration | None, tuple[str, ...]]:
    """Return the calibration in force at the first sample, and a remark if another one followed."""
    if not run.calibrations or recording.origin_ns is None:
        return None, ()
    first_ns, last_ns = (recording.origin_ns + round(float(recording.time_s[end]) * 1e9) for end in (0, -1))
    known = [calibration for calibration in run.calibrations if calibration.log_time_ns <= first_ns]
    later = [calibration for calibration in run.calibrations if first_ns < calibration.log_time_ns <= last_ns]
    in_force = known[-1] if known else run.calibrations[0]
    changes = [calibration for calibration in later if calibration is not in_force]
    if not changes:
        return in_force.message, ()
    change_s = (changes[0].log_time_ns - recording.origin_ns) / 1e9
    remark = f"another calibration came into force at {change_s:.3f} s and is not used; measure that part with --from"
    return in_force.message, (remark,)
