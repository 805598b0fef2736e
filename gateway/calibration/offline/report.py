"""A calibration for people: poses, offsets, scales, misalignment, budget."""

import numpy as np

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.record import CalibrationRecord


def as_text(record: CalibrationRecord, acceptance: Acceptance, notes: tuple[str, ...]) -> str:
    """Several lines, to be printed."""
    return "\n".join(
        [
            f"{record.method} of {record.device_id}, {record.created_utc} by {record.by}, raw input in {record.unit}",
            f"record {record.id}",
            "",
            *_poses(record),
            "",
            *_axes(record),
            "",
            *_budget(record),
            "",
            f"residual {_mg(record.residual_rms_g)} rms, condition number {record.condition_number:.3g}, "
            f"|m| at rest within 1 +- {record.prediction_interval_g:.4f}",
            *_temperature(record),
            *(f"warning: {text}" for text in record.warnings),
            *(f"note: {text}" for text in notes),
            *(f"needs a reason: {text}" for text in acceptance.needs_reason),
            *(f"not acceptable: {text}" for text in acceptance.refusals),
        ]
    )


def _poses(record: CalibrationRecord) -> list[str]:
    lines = [f"{'pose':>4}  {'up':4} {'readings':>8}  {'mean':^38}  {'type A':>8}"]
    for number, pose in enumerate(record.poses, start=1):
        mean = " ".join(f"{value:12.6g}" for value in pose["mean"])
        used = "" if pose["used"] else "  not used"
        lines.append(f"{number:4}  {pose['face'] or '-':4} {pose['count']:8}  {mean}  {max(pose['type_a']):8.2g}{used}")
    return lines


def _axes(record: CalibrationRecord) -> list[str]:
    sensitivity = np.linalg.inv(np.array(record.correction_matrix))
    u_scale, u_offset_g = record.u_scale_factor, record.u_zero_g_offset_g
    misalignment = record.misalignment_deg or {}
    lines = [f"axis  {'offset':>12}  {'u':>9}  {'per g':>12}  {'u':>8}  misalignment"]
    for place, axis in enumerate("xyz"):
        angles = ", ".join(f"{value:+.3f}" for value in misalignment.get(axis, ()))
        lines.append(
            f"{axis:4}  {record.offset[place]:12.6g}  {_mg(u_offset_g[place]):>9}  {sensitivity[place, place]:12.6g}  "
            f"{u_scale[place] * 100:6.3f} %  {angles} deg"
        )
    return lines


def _budget(record: CalibrationRecord) -> list[str]:
    rows = [f"  {row.type}  {row.source:40} {_mg(row.u_g):>10}  {row.u_deg:.4f} deg" for row in record.budget]
    u_g = float(np.sqrt(sum(row.u_g**2 for row in record.budget)))
    u_deg = float(np.sqrt(sum(row.u_deg**2 for row in record.budget)))
    return ["standard uncertainty of a reading", *rows, f"     {'together':40} {_mg(u_g):>10}  {u_deg:.4f} deg"]


def _temperature(record: CalibrationRecord) -> list[str]:
    seen = record.temperature_c
    return [] if seen is None else [f"temperature {seen['mean']:.1f} C, {seen['min']:.1f} to {seen['max']:.1f}"]


def _mg(value_g: float | None) -> str:
    return "unknown" if value_g is None else f"{value_g * 1000:.3f} mg"
