"""A measurement as text for the terminal and as the content of `measure --json`."""

from dataclasses import asdict
from typing import Any

from devices.pendulum.small_swing import period_ratio
from devices.recording import Recording
from gateway.measurement.measure import Measurement
from gateway.measurement.motion import BY_SMOOTHING, motion_json, motion_rows
from gateway.measurement.source import Source
from gateway.measurement.swing import not_judged, relative_s
from gateway.recording.reading.interval import iso_utc
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import VALID_RHO
from gateway.units import degrees

MAX_SHOWN_REMARKS = 8
"""Remarks in the text for the terminal. Basis: a choice; half a screen."""


def as_json(source: Source, found: Measurement) -> dict[str, Any]:
    """Return the content of `measure --json`."""
    return {
        "files": [str(path) for path in source.files],
        "interval": _interval(source),
        "free_swing": _free_swing(source, found),
        "remarks": list(found.judged.remarks),
        "samples": _samples(source.recording) | {"repeated_readings": source.repeated_readings},
        "calibration": source.calibration,
        "formulas_deg": _formulas_deg(found.formulas.as_published),
        "formulas_corrected_deg": _formulas_deg(found.formulas.corrected),
        "formulas_valid_rho": {name: list(valid) for name, valid in VALID_RHO.items()},
        "swing": _swing(found.swing) if found.swing.swinging else None,
        "swing_upper_bound_deg": _upper_bound_deg(found.swing),
        "swing_reasons": list(found.swing.reasons),
        "hoists_s": [list(when) for when in found.swing.hoists_s],
        "swings": _swings(found),
        "motion": None if found.motion is None else motion_json(found.motion),
        "tilt": {
            "pitch_deg": degrees(found.tilt.pitch_rad),
            "roll_deg": degrees(found.tilt.roll_rad),
            "axial_deg": degrees(found.axial_rad),
            "plain_pitch_deg": degrees(found.arctangent_tilt.pitch_rad),
            "plain_roll_deg": degrees(found.arctangent_tilt.roll_rad),
            "roll_gamma_deg": degrees(found.roll_gamma_rad),
        },
        "conditions": {
            "verdict": found.conditions.verdict,
            "cause": found.conditions.cause,
            "reasons": list(found.conditions.reasons),
            "windows": found.conditions.windows,
        },
    }


def _interval(source: Source) -> dict[str, float | str | None]:
    """Return the times of the first and the last sample, from the start of the recording and in UTC where it is known."""
    extent = source.extent
    from_s, to_s = (float(source.recording.time_s[end]) for end in (0, -1))
    from_ns, to_ns = extent.utc_ns(from_s), extent.utc_ns(to_s)
    return {
        "from_s": from_s - extent.first_s,
        "to_s": to_s - extent.first_s,
        "from_utc": None if from_ns is None else iso_utc(from_ns),
        "to_utc": None if to_ns is None else iso_utc(to_ns),
    }


def _free_swing(source: Source, found: Measurement) -> dict[str, Any] | None:
    """Return the judged interval, all free swings and what was held, from the start of the recording; None: nothing was held."""
    if found.free_swing is None:
        return None
    from_s, to_s = relative_s(source, found.free_swing.longest)
    return {
        "from_s": from_s,
        "to_s": to_s,
        "intervals_s": [list(relative_s(source, each)) for each in found.free_swing.intervals],
        "held_s": [list(relative_s(source, each)) for each in found.free_swing.held],
        "not_judged_s": [list(relative_s(source, each)) for each in not_judged(found.free_swing)],
    }


def _samples(recording: Recording) -> dict[str, float]:
    return {
        "count": len(recording),
        "duration_s": float(recording.time_s[-1] - recording.time_s[0]),
        "rate_hz": recording.rate_hz,
        "lost": recording.lost,
        "repeated": recording.repeated,
        "backward": recording.backward,
        "invalid": recording.invalid,
        "blank": recording.blank,
        "truncated": recording.truncated,
    }


def _formulas_deg(angles: FormulaAngles) -> dict[str, float | None]:
    return {name: degrees(angle_rad) for name, angle_rad in asdict(angles).items()}


def _swings(found: Measurement) -> list[dict[str, Any]]:
    return [
        {
            "time_s": peak.time_s,
            "phi_max_deg": degrees(peak.phi_max_rad),
            "u_deg": degrees(peak.u_rad),
            "formulas_deg": _formulas_deg(formulas.as_published),
            "formulas_corrected_deg": _formulas_deg(formulas.corrected),
        }
        for peak, formulas in zip(found.swing.swings, found.formulas_by_swing, strict=True)
    ]


def _swing(estimate: SwingEstimate) -> dict[str, Any]:
    coverage = estimate.coverage95_rad
    return {
        "phi_max_deg": degrees(estimate.phi_max_rad),
        "u_deg": degrees(estimate.u_rad),
        "coverage95_deg": None if coverage is None else [degrees(coverage[0]), degrees(coverage[1])],
        "period_s": estimate.period_s,
        "period_measured_s": measured_period_s(estimate),
        "minor_phi_max_deg": degrees(estimate.minor_phi_max_rad),
        "azimuth_deg": degrees(estimate.azimuth_rad),
        "lean_deg": degrees(estimate.lean_rad),
        "lean_u_deg": degrees(estimate.lean_u_rad),
        "lean_azimuth_deg": degrees(estimate.lean_azimuth_rad),
        "length_m": estimate.length_m,
        "length_u_m": estimate.length_u_m,
        "damping_ratio": estimate.damping_ratio,
        "reduced_chi_square": estimate.reduced_chi_square,
    }


def _upper_bound_deg(estimate: SwingEstimate) -> float | None:
    return None if estimate.coverage95_rad is None else degrees(estimate.coverage95_rad[1])


def as_text(source: Source, found: Measurement) -> str:
    """Return one line for each part of the result."""
    recording = source.recording
    faults = {
        "lost": recording.lost,
        "repeated": recording.repeated,
        "backward": recording.backward,
        "unusable": recording.invalid,
    }
    faulty = ", ".join(f"{count} {name}" for name, count in faults.items() if count) or "none lost"
    pitch, roll, axial = (_angle_text(angle) for angle in (found.tilt.pitch_rad, found.tilt.roll_rad, found.axial_rad))
    duration_s = float(recording.time_s[-1] - recording.time_s[0])
    samples = f"{len(recording)} samples in {duration_s:.4g} s at {recording.rate_hz:.4g} Hz, {faulty}"
    rows = [
        ("recording", f"{source.name}, {samples}"),
        *(("remark", text) for text in _remarks(found.judged)),
        ("calibration", source.calibration),
        *_swing_rows(source, found),
        *(() if found.motion is None else motion_rows(found.motion)),
        (
            "formulas",
            "  ".join(f"{name} {_angle_text(angle)}" for name, angle in asdict(found.formulas.as_published).items()),
        ),
        ("tilt", f"pitch {pitch}  roll {roll}  axial {axial}"),
        ("condition", f"{found.conditions.verdict}: {'; '.join(found.conditions.reasons)}"),
    ]
    return "\n".join(f"{label:<12} {text}" for label, text in rows)


def _judged_text(source: Source, found: Measurement) -> str:
    """Return for which part of the recording the swing holds; nothing where that is the whole."""
    if found.free_swing is None:
        return ""
    from_s, to_s = relative_s(source, found.free_swing.longest)
    return f"; from {from_s:.1f} to {to_s:.1f} s alone, the rest is not judged"


def _remarks(source: Source) -> list[str]:
    """Return the first remarks, and the number of the others."""
    others = len(source.remarks) - MAX_SHOWN_REMARKS
    more = [f"and {others} more; --json has all of them"] if others > 0 else []
    return [*source.remarks[:MAX_SHOWN_REMARKS], *more]


def measured_period_s(estimate: SwingEstimate) -> float | None:
    """Return the period at the largest angle, which grows with the amplitude; None where it is not known.

    That of a planar swing; a circular one is a little faster than a small swing.
    """
    if estimate.period_s is None or estimate.phi_max_rad is None:
        return None
    return estimate.period_s * period_ratio(estimate.phi_max_rad)


def _angle_text(angle_rad: float | None) -> str:
    value = degrees(angle_rad)
    return "-" if value is None else f"{value:.3f}°"


def _swing_rows(source: Source, found: Measurement) -> list[tuple[str, str]]:
    """Return label and text of each line: the angle, why it is as it is, and what else the fit of a pendulum found."""
    estimate = found.swing
    is_unknown, reasons = estimate.swinging is None, estimate.reasons
    swing = ": ".join(["unknown", *reasons[:1]]) if is_unknown else _swing_text(estimate)
    rows = [("swing", swing + _judged_text(source, found)), *(("", text) for text in reasons[is_unknown:])]
    if not estimate.swinging or estimate.length_m is None or estimate.length_u_m is None:
        return rows
    length = f"{estimate.length_m:.4g} m ± {estimate.length_u_m:.2g} m"
    measured_s = measured_period_s(estimate)
    period = "" if measured_s is None else f" of {measured_s:.3g} s (small swing {estimate.period_s:.3g} s)"
    how = "the smoothed motion" if BY_SMOOTHING in reasons else f"the period{period}"
    return [*rows, ("rope", f"{length} by {how}, lean {_angle_text(estimate.lean_rad)}")]


def _swing_text(estimate: SwingEstimate) -> str:
    coverage = estimate.coverage95_rad
    if not estimate.swinging:
        return f"none, below {'unknown' if coverage is None else _angle_text(coverage[1])}"
    if coverage is None:
        return f"{_angle_text(estimate.phi_max_rad)}, uncertainty unknown"
    return f"{_angle_text(estimate.phi_max_rad)}, 95 % within {_angle_text(coverage[0])} to {_angle_text(coverage[1])}"
