"""What a reconciliation writes: predictions as recordings, the found model as a rig."""

from collections.abc import Sequence

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gateway.measurement.source import HeldRows
from gateway.twin.model import as_tables
from gateway.twin.reconcile.output.result import Curves, Reconciliation

Array = NDArray[np.float64]


def format_prediction_csv(
    curves: Sequence[Curves], held: HeldRows | None = None, row_times_s: Array | None = None
) -> str:
    """The final model's prediction, one row per row of the recording; parts of one recording follow each other.

    Rows that repeat a reading repeat its prediction. Of means of samples, the prediction is that of a curve through them at the
    times of the rows (n,).
    """
    parts, begin_s = [], 0.0
    for each in curves:
        parts.append(np.column_stack([each.time_s + begin_s, each.after_g]))
        begin_s += 2 * float(each.time_s[-1]) - float(each.time_s[-2])
    rows = np.concatenate(parts) if parts else np.empty((0, 4))
    if row_times_s is not None and len(rows):
        elapsed_s = row_times_s - row_times_s[0]
        rows = np.column_stack([elapsed_s, CubicSpline(rows[:, 0], rows[:, 1:])(elapsed_s)])
    if held is not None:
        rows = np.column_stack([held.time_s - held.time_s[0], rows[held.reading, 1:]])
    lines = ["{:.6f},{:.7f},{:.7f},{:.7f}".format(*row) for row in rows.tolist()]
    return "\n".join(["time_s,ax_g,ay_g,az_g", *lines, ""])


def format_model_toml(result: Reconciliation) -> str:
    """The rig with the model that was found, in the form that `--rig` reads."""
    rig = result.rig
    sensor: dict[str, object] = {"noise_g": list(rig.noise_g)}
    if rig.sample_rate_hz is not None:
        sensor["sample_rate_hz"] = rig.sample_rate_hz
    if rig.full_scale_g is not None:
        sensor["full_scale_g"] = rig.full_scale_g
    return tomli_w.dumps(
        {
            "rope": {"length_m": rig.length_m},
            "housing": {"position_m": rig.position_m},
            "sensor": sensor,
            "site": {"gravity_m_s2": rig.gravity_m_s2},
            "model": as_tables(result.model),
        }
    )
