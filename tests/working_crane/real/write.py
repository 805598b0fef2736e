"""A recording as a folder of files: log.csv, truth.csv, gateway.toml, rig.toml, case.json."""

import json
from pathlib import Path

import numpy as np

from tests.working_crane.real.recording import Recording
from tests.working_crane.write import gateway_toml, write_table

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
    write_table(folder / "log.csv", dict.fromkeys(("time_s", "ax_g", "ay_g", "az_g"), "%.5f"), log)
    write_table(folder / "truth.csv", COLUMNS, np.column_stack([recording.truth[name] for name in COLUMNS]))
    housing = {key: value for key, value in recording.stated.items() if key != "length_m"}
    lines = [f"{key} = {value:.{0 if key == 'mount_u_deg' else 2}f}" for key, value in housing.items()]
    (folder / "gateway.toml").write_text(gateway_toml(f"{recording.stated['length_m']:.2f}", *lines))
    (folder / "rig.toml").write_text(rig_toml(recording))
    (folder / "case.json").write_text(json.dumps(recording.facts, indent=1))


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
