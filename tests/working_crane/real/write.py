"""A recording as a folder of files: log.csv, truth.csv, gateway.toml, rig.toml, case.json."""

import json
from pathlib import Path

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.recording import Recording

COLUMNS = {
    "time_s": "%.3f",
    "angle_deg": "%.4f",
    "azimuth_deg": "%.1f",
    "driven": "%d",
    "hoisting": "%d",
    "gust": "%d",
    "length_m": "%.3f",
    "slope_deg": "%.3f",
    "load_deg": "%.3f",
}


def write_recording(recording: Recording, folder: Path) -> None:
    """Write the five files; the folder may be there already."""
    folder.mkdir(parents=True, exist_ok=True)
    log = np.column_stack([recording.log_time_s, recording.reading_g])
    _write_csv(folder / "log.csv", "time_s,ax_g,ay_g,az_g", "%.5f,%.5f,%.5f,%.5f", log)
    table = np.column_stack([recording.truth[name] for name in COLUMNS])
    _write_csv(folder / "truth.csv", ",".join(COLUMNS), ",".join(COLUMNS.values()), table)
    (folder / "gateway.toml").write_text(gateway_toml(recording))
    (folder / "rig.toml").write_text(rig_toml(recording))
    (folder / "case.json").write_text(json.dumps(recording.facts, indent=1))


def gateway_toml(recording: Recording) -> str:
    """Return the configuration that replays the log."""
    stated = dict(recording.stated)
    length_m = stated.pop("length_m")
    housing = "\n".join(f"{key} = {value:.{0 if key == 'mount_u_deg' else 2}f}" for key, value in stated.items())
    return f"""[gateway]
site = "yard"
crane = "crane-1"
sensor = "hook-1"
[device]
kind = "replay"
path = "log.csv"
speed = 0
[rope]
length_m = {length_m:.2f}
[housing]
{housing}
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


def rig_toml(recording: Recording) -> str:
    """Return the description of the rig for simulations; its place is stated from the pivot."""
    stated = recording.stated
    position_m = stated.get("position_m", stated["length_m"] - stated.get("above_load_m", 0.0))
    return f"""[rope]
length_m = {stated["length_m"]:.2f}
[housing]
position_m = {position_m:.2f}
[sensor]
sample_rate_hz = {recording.facts["fs_hz"]}
noise_g = {recording.facts["noise_g"]}
full_scale_g = 2.0
[site]
gravity_m_s2 = 9.80665
"""


def _write_csv(path: Path, header: str, row_format: str, table: Array) -> None:
    row_format += "\n"
    path.write_text(header + "\n" + "".join(row_format % tuple(row) for row in table.tolist()))
