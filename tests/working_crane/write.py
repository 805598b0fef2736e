"""A case as a folder of files: log.csv, truth.csv, gateway.toml, case.json."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.blind.mechanics import Array
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
LOG_FORMATS = {"time_s": "%.6f", "ax_g": "%.7f", "ay_g": "%.7f", "az_g": "%.7f"}
BEFORE_ROPE = """[gateway]
site = "yard"
crane = "crane-1"
sensor = "hook-1"
[device]
kind = "replay"
path = "log.csv"
speed = 0
[rope]"""
AFTER_HOUSING = """[site]
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


def write_case(case: Case, recording: Recording, folder: Path) -> None:
    """Write the four files; the folder may be there already."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "log.csv", LOG_FORMATS, np.column_stack([recording.time_s, recording.reading_g]))
    formats = {name: FORMATS.get(name, "%.6f") for name in recording.truth}
    write_table(folder / "truth.csv", formats, np.column_stack(list(recording.truth.values())))
    above_load = f"above_load_m = {case.crane.above_load_m:.3f}"
    (folder / "gateway.toml").write_text(gateway_toml(f"{case.believed_length_m:.3f}", above_load))
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


def gateway_toml(length_m: str, *housing: str) -> str:
    """Return the configuration that replays the log, with the stated rope and the lines of the housing."""
    return "\n".join([BEFORE_ROPE, f"length_m = {length_m}", "[housing]", *housing, AFTER_HOUSING])


def write_table(path: Path, formats: Mapping[str, str], table: Array) -> None:
    """Write a table, (n, k), as CSV; `formats` are those of its columns by their names."""
    row_format = ",".join(formats.values()) + "\n"
    path.write_text(",".join(formats) + "\n" + "".join(row_format % tuple(row) for row in table.tolist()))
