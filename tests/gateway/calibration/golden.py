"""Calibrations of fixed readings, whose records are kept in `tests/data/calibration/golden_records.json`.

Write the file anew, after a change that is meant to change records: `python -m tests.gateway.calibration.golden`.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from devices.tables.layout import TableLayout
from devices.tables.native import read_table
from gateway.calibration.acceptance import make_record
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.methods.norm_fit import fit_norm
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.methods.zeroing import zero_in_place
from gateway.calibration.pose import NominalSensitivity, Pose, RawReadings, candidate_directions, find_face
from gateway.calibration.pose_procedure import make_procedure
from gateway.calibration.record import CalibrationRecord

DATA = Path(__file__).parents[2] / "data" / "calibration"
GOLDEN_RECORDS = DATA / "golden_records.json"
TABLES = json.loads((DATA / "luczak_2022_tables.json").read_text())
UNITS_PER_G = 256.0
GAIN = np.array([[1.03, 0.02, -0.02], [0.01, 0.97, 0.02], [-0.02, 0.02, 1.03]])
OFFSET_G = np.array([0.05, -0.05, 0.05])


def golden_records() -> dict[str, dict[str, Any]]:
    """Records of fixed readings by each method, as JSON."""
    records: dict[str, dict[str, Any]] = {}
    parent = _record(_norm_fit(None))
    records["norm-fit"] = parent.model_dump(mode="json")
    records["norm-fit with parent"] = _record(_norm_fit(parent), parent).model_dump(mode="json")
    records["zero"] = _record(_zero(parent), parent).model_dump(mode="json")
    for number in (1, 3):  # table 3 has an outlier
        records[f"six-position, table {number}"] = _record(fit_six_positions(_table(number)), unit="V").model_dump(
            mode="json"
        )
    for name, rate_hz, units_per_g in (("six_faces_session", 204.8, 2048.0), ("many_poses_session", 100.0, 16384.0)):
        records[f"six-position, {name}"] = _record(_session(name, rate_hz, units_per_g)).model_dump(mode="json")
    return records


def _record(fit: CalibrationFit, parent: CalibrationRecord | None = None, unit: str = "counts") -> CalibrationRecord:
    return make_record(
        fit,
        device_id="part-7",
        unit=unit,
        software="0.1.0",
        by="bench",
        created_utc="2026-11-21T10:15:00Z",
        parent=None if parent is None else parent.id,
    )


def _norm_fit(parent: CalibrationRecord | None) -> CalibrationFit:
    random = np.random.default_rng(8)
    directions = candidate_directions()[::2]
    means = (directions @ GAIN.T + OFFSET_G + 2e-4 * random.standard_normal(directions.shape)) * UNITS_PER_G
    u = 1e-4 * UNITS_PER_G
    poses = tuple(
        Pose((x, y, z), (u, u, u), 300, find_face(up), temperature_c=20.0 + place / 4, noise=(0.5, 0.5, 0.75), step=1.0)
        for place, ((x, y, z), up) in enumerate(zip(means.tolist(), directions, strict=True))
    )
    return fit_norm(poses, UNITS_PER_G, parent=parent)


def _zero(parent: CalibrationRecord) -> CalibrationFit:
    random = np.random.default_rng(4)
    time_s = np.arange(2000) / 50
    force_g = np.array([0.03, -0.05, np.sqrt(1 - 0.03**2 - 0.05**2)]) + 1e-3 * random.standard_normal((2000, 3))
    return zero_in_place(
        RawReadings(time_s, (force_g @ GAIN.T + OFFSET_G) * UNITS_PER_G, 22.0), parent, np.eye(3), UNITS_PER_G
    )


def _table(number: int) -> tuple[Pose, ...]:
    """Poses of one of tables 1 to 5 of Łuczak et al. 2022."""
    u_v = TABLES["type_A_uncertainty_V"]
    means = [(row["U_x_V"], row["U_y_V"], row["U_z_V"]) for row in TABLES["tables_1_to_5"][number - 1]["positions"]]
    return tuple(Pose(mean, (u_v, u_v, u_v), 300, find_face((np.array(mean) - 1.5) / 0.42)) for mean in means)


def _session(name: str, rate_hz: float, units_per_g: float) -> CalibrationFit:
    procedure = make_procedure("six-position", NominalSensitivity(units_per_g))
    for readings in _readings(DATA / f"{name}.csv", rate_hz):
        procedure.feed(readings)
    return procedure.finish()


def _readings(path: Path, rate_hz: float) -> Iterator[RawReadings]:
    axes = path.read_text().splitlines()[0].split(",")
    recording = read_table(path, TableLayout(axes=(axes[-3], axes[-2], axes[-1]), unit="g", rate_hz=rate_hz))
    for start in range(0, len(recording.time_s), 64):
        yield RawReadings(recording.time_s[start : start + 64], recording.raw[start : start + 64], 21.5)


if __name__ == "__main__":
    lines = [f"{json.dumps(name)}: {json.dumps(content)}" for name, content in golden_records().items()]
    GOLDEN_RECORDS.write_text("{\n" + ",\n".join(lines) + "\n}\n")
