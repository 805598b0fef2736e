"""A case as a folder of files: log.csv, truth.csv, gateway.toml, case.json."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.working_crane.crane import Case
from tests.working_crane.events import as_json
from tests.working_crane.recording import Recording

FORMATS = {
    "angle_deg": "%.6f",
    "azimuth_deg": "%.3f",
    "driven": "%d",
    "hoisting": "%d",
    "gust": "%d",
    "length_m": "%.4f",
    "heading_deg": "%.3f",
}
"""Of the columns of truth.csv; others have six digits."""


def write_case(case: Case, recording: Recording, folder: Path) -> None:
    """Write the four files; the folder may be there already."""
    folder.mkdir(parents=True, exist_ok=True)
    log = np.column_stack([recording.time_s, recording.reading_g])
    _write_csv(folder / "log.csv", "time_s,ax_g,ay_g,az_g", "%.6f,%.7f,%.7f,%.7f", log)
    names, columns = zip(*recording.truth.items(), strict=True)
    formats = ",".join(FORMATS.get(name, "%.6f") for name in names)
    _write_csv(folder / "truth.csv", ",".join(names), formats, np.column_stack(columns))
    (folder / "gateway.toml").write_text(gateway_toml(case))
    (folder / "case.json").write_text(json.dumps(case_json(case), indent=1))


def case_json(case: Case) -> dict[str, Any]:
    """Return what was drawn; the keys of the given recordings first."""
    crane, block = case.crane, None
    if crane.hook is not None:
        block = {"rigging_length_m": crane.hook.rigging_length_m, "hook_mass_ratio": crane.hook.mass_ratio}
        block["initial_deg"] = case.extra["initial_deg"]
    return {
        "seed": case.seed,
        "length_m": crane.length_m,
        "rho": case.rho,
        "noise_g": case.sensor.noise_g,
        "hook": block,
        "damping_ratio": crane.damping_ratio,
        "events": [as_json(event) for event in case.events],
        "kind": case.kind,
        "steady_wind_m_s2": case.steady_wind_m_s2,
        "jib": None if crane.jib is None else asdict(crane.jib),
        "sensor": asdict(case.sensor),
        **case.extra,
    }


def gateway_toml(case: Case) -> str:
    """Return the configuration that replays the log."""
    return f"""[gateway]
site = "yard"
crane = "crane-1"
sensor = "hook-1"
[device]
kind = "replay"
path = "log.csv"
speed = 0
[rope]
length_m = {case.believed_length_m:.3f}
[housing]
above_load_m = {case.crane.above_load_m:.3f}
[site]
gravity_m_s2 = 9.80665
[alerts]
warn_deg = 4.0
trip_deg = 6.0
clear_deg = 3.0
hold_s = 3.0
lean_trip_deg = 5.0
[page]
enabled = false
"""


def _write_csv(path: Path, header: str, row_format: str, table: np.ndarray) -> None:
    row_format += "\n"
    path.write_text(header + "\n" + "".join(row_format % tuple(row) for row in table.tolist()))
