"""The text output of `plumbline calibrate`: poses, offsets, scale factors, misalignment, uncertainty budget."""

import numpy as np

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.record import CalibrationRecord

MAX_POSE_LINES = 40
"""More poses, as those of a rotation, are in the record alone. Basis: a choice; a screen or a page."""


def format_report(record: CalibrationRecord, acceptance: Acceptance, notes: tuple[str, ...]) -> str:
    """Return the report as several lines of text."""
    return "\n".join(
        [
            f"{record.method} of {record.device_id}, {record.created_utc} by {record.by}, raw input in {record.unit}",
            f"record {record.id}",
            "",
            *_pose_lines(record),
            "",
            *_axis_lines(record),
            "",
            *_budget_lines(record),
            "",
            f"residual {_format_mg(record.residual_rms_g)} rms, condition number {record.condition_number:.3g}, "
            f"|m| at rest within 1 +- {record.prediction_interval_g:.4f}",
            *_temperature_lines(record),
            *(f"warning: {text}" for text in record.warnings),
            *(f"note: {text}" for text in notes),
            *(f"needs a reason: {text}" for text in acceptance.implausible),
            *(f"not acceptable: {text}" for text in acceptance.refused),
        ]
    )


def _pose_lines(record: CalibrationRecord) -> list[str]:
    if len(record.poses) > MAX_POSE_LINES:
        return [f"{len(record.poses)} poses, listed in the record"]
    lines = [f"{'pose':>4}  {'up':4} {'readings':>8}  {'mean':^38}  {'type A':>8}"]
    for number, pose in enumerate(record.poses, start=1):
        mean = " ".join(f"{value:12.6g}" for value in pose["mean"])
        used = "" if pose["used"] else "  not used"
        lines.append(f"{number:4}  {pose['face'] or '-':4} {pose['count']:8}  {mean}  {max(pose['type_a']):8.2g}{used}")
    return lines


def _axis_lines(record: CalibrationRecord) -> list[str]:
    sensitivity = np.linalg.inv(np.array(record.correction_matrix))
    u_scale, u_offset_g = record.u_scale_factor, record.u_zero_g_offset_g
    misalignment = record.misalignment_deg or {}
    lines = [f"axis  {'offset':>12}  {'u':>9}  {'per g':>12}  {'u':>8}  misalignment"]
    for place, axis in enumerate("xyz"):
        angles = ", ".join(f"{value:+.3f}" for value in misalignment.get(axis, ()))
        lines.append(
            f"{axis:4}  {record.offset[place]:12.6g}  {_format_mg(u_offset_g[place]):>9}  "
            f"{sensitivity[place, place]:12.6g}  {u_scale[place] * 100:6.3f} %  {angles} deg"
        )
    return lines


def _budget_lines(record: CalibrationRecord) -> list[str]:
    rows = [f"  {row.type}  {row.source:40} {_format_mg(row.u_g):>10}  {row.u_deg:.4f} deg" for row in record.budget]
    u_g = float(np.sqrt(sum(row.u_g**2 for row in record.budget)))
    u_deg = float(np.sqrt(sum(row.u_deg**2 for row in record.budget)))
    return ["standard uncertainty of a reading", *rows, f"     {'combined':40} {_format_mg(u_g):>10}  {u_deg:.4f} deg"]


def _temperature_lines(record: CalibrationRecord) -> list[str]:
    known = record.temperature_c
    return [] if known is None else [f"temperature {known['mean']:.1f} C, {known['min']:.1f} to {known['max']:.1f}"]


def _format_mg(value_g: float | None) -> str:
    return "unknown" if value_g is None else f"{value_g * 1000:.3f} mg"
