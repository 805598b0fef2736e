"""A case as a folder of files: rig.toml, log.csv, held_out.csv, truth.json."""

import json
from pathlib import Path

import numpy as np

from tests.blind.cases import Case
from tests.blind.scene import Rig
from tests.blind.sensor import Recording

HEADER = "time_s,ax_g,ay_g,az_g,temperature_c"
FORMAT = "%.6f,%.7f,%.7f,%.7f,%.3f"


def write_case(case: Case, folder: Path) -> None:
    """Write the files; the folder may be there already."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(rig_toml(case.rig))
    for name, recording in case.recordings.items():
        _write_csv(recording, folder / f"{name}.csv")
    (folder / "truth.json").write_text(json.dumps(case.truth, indent=1))


def rig_toml(rig: Rig) -> str:
    """What is believed."""
    return f"""# What is believed of this rig before the measurement is looked at.
[rope]
length_m = {rig.length_m}        # pivot to the load's centre
[housing]
position_m = {rig.position_m}      # pivot to the accelerometer, along the rope
[sensor]
sample_rate_hz = {rig.rate_hz:g}
noise_g = {rig.noise_g}           # 1-sigma per sample and axis
full_scale_g = {rig.full_scale_g}
[site]
gravity_m_s2 = {rig.gravity_m_s2}
"""


def _write_csv(recording: Recording, path: Path) -> None:
    table = np.column_stack([recording.time_s, recording.force_g, recording.temperature_c])
    line = FORMAT + "\n"
    path.write_text(HEADER + "\n" + "".join(line % tuple(row) for row in table.tolist()))
