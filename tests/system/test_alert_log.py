"""The changes of alerts in the log of a gateway: on standard error and in the recording."""

import math
from pathlib import Path

import numpy as np
import pytest

from devices.pendulum.pendulum import start_motion
from devices.simulated.crane import Crane
from gateway.messages import Alert, Log
from gateway.recording.reading.recording_file import open_recording
from tests.system.conftest import StartGateway

pytestmark = pytest.mark.slow

LENGTH_M, POSITION_M, RATE_HZ, GRAVITY_M_S2 = 8.0, 5.0, 50.0, 9.80665
CONFIGURATION = """
[device]
kind = "replay"
speed = 0
path = "{path}"
[rope]
length_m = 8.0
[housing]
position_m = 5.0
[alerts]
warn_deg = 4.0
trip_deg = 6.0
clear_deg = 3.0
hold_s = 2.0
"""


def write_dying_swing(path: Path) -> None:
    motion = start_motion(math.radians(8.0), 0.0, 0.0, 0.0)
    crane = Crane(
        length_m=LENGTH_M, position_m=POSITION_M, gravity_m_s2=GRAVITY_M_S2, motion=motion, damping_ratio=0.03
    )
    time_s = np.arange(0, 60.0, 1 / RATE_HZ)
    force_g = np.concatenate([crane.specific_force_m_s2(part) for part in np.array_split(time_s, 30)]) / GRAVITY_M_S2
    force_g += np.random.default_rng(3).normal(0, 3e-4, force_g.shape)
    rows = np.column_stack([time_s, force_g])
    np.savetxt(path, rows, delimiter=",", header="time_s,ax_g,ay_g,az_g", comments="", fmt="%.7f")


def test_each_change_of_an_incident_is_one_line_on_standard_error_and_in_the_recording(
    start_gateway: StartGateway, tmp_path: Path
) -> None:
    write_dying_swing(tmp_path / "swing.csv")
    gateway = start_gateway(CONFIGURATION.format(path=tmp_path / "swing.csv"), arguments=("--quiet",))
    code, _, err = gateway.wait()
    assert code == 0
    (path,) = gateway.recordings
    file = open_recording(path)
    decoded = [file.decode(message) for message in file.messages()]
    boot_id = file.metadata["plumbline"]["boot_id"]
    changes = [each for each in decoded if isinstance(each, Alert) and each.incident is not None]
    assert [change.event for change in changes][:1] == ["raised"]
    assert [change.event for change in changes][-1:] == ["cleared"]
    assert {change.incident for change in changes} == {f"{boot_id}-1"}
    recorded = [each.message for each in decoded if isinstance(each, Log) and each.name == "plumbline.alert"]
    assert [line for line in recorded if "incident" in line] == [change.change for change in changes]
    assert err.splitlines() == [f"WARNING plumbline.alert: {change.change}" for change in changes]
