"""The twin against MuJoCo, an independent rigid-body engine."""

from typing import Any

import mujoco
import numpy as np
import pytest

from gateway.twin.model import TwinRig
from tests.gateway.twin.swings import Array, G, predicted

STEP_S = 0.002
EVERY = 25
"""Steps from one sample to the next."""
LENGTH_M, POSITION_M = 9.0, 4.0
ONE = """<mujoco><option timestep="{step}" gravity="0 0 -{g}" integrator="RK4"><flag contact="disable"/></option><worldbody>
<body><joint type="ball"/><site name="housing" pos="{beside} -{r}"/>
<geom type="sphere" size=".001" pos="0 0 -{upper}" mass="{hook}"/>{below}</body></worldbody>
<sensor><accelerometer site="housing"/></sensor></mujoco>"""
BELOW = """<body pos="0 0 -{upper}"><joint type="ball"/><geom type="sphere" size=".001" pos="0 0 -{lower}" mass="1"/></body>"""


def engine(below: str = "", upper: float = LENGTH_M, hook: float = 1.0, beside: str = "0 0") -> tuple[Any, Any]:
    text = ONE.format(step=STEP_S, g=G, r=POSITION_M, upper=upper, hook=hook, below=below, beside=beside)
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def tilted(angle_rad: float) -> list[float]:
    """Return the quaternion of a rotation about y, which tilts a rope toward the world's x."""
    return [np.cos(angle_rad / 2), 0.0, -np.sin(angle_rad / 2), 0.0]


def recorded(model: Any, data: Any, seconds: float) -> tuple[Array, Array]:
    mujoco.mj_forward(model, data)
    readings = []
    for step in range(round(seconds / STEP_S)):
        if step % EVERY == 0:
            mujoco.mj_forward(model, data)
            readings.append(data.sensordata.copy() / G)
        mujoco.mj_step(model, data)
    time_s = np.arange(len(readings), dtype=np.float64) * STEP_S * EVERY
    return time_s, np.array(readings)


@pytest.mark.slow
def test_spherical_pendulum_agrees_with_mujoco() -> None:
    model, data = engine()
    tilt, across = 0.15, 0.06
    data.qpos[:4] = tilted(tilt)
    data.qvel[:3] = [across / np.cos(tilt) * np.cos(tilt), 0.0, 0.0]  # n' = w x n: across, in the body's own frame
    time_s, reading = recorded(model, data, 30.0)
    found = predicted(TwinRig(LENGTH_M, POSITION_M), {}, [tilt, 0.0, 0.0, across, 0.0], time_s)
    assert found[:, 2] == pytest.approx(reading[:, 2], abs=5e-6)
    assert np.hypot(*found[:, :2].T) == pytest.approx(np.hypot(*reading[:, :2].T), abs=5e-6)
    assert found == pytest.approx(reading, abs=2e-5)  # the axes, too: a ball joint keeps what parallel transport keeps


def test_sensor_beside_the_rope_of_a_turning_housing_agrees_with_mujoco() -> None:
    """A housing that turns at 0.4 rad/s on a rope that turns about two axes: tangential, centripetal and Coriolis parts."""
    model, data = engine(beside="0.3 -0.2")
    tilt, across, spin_rad_s = 0.3, 0.1, 0.4
    data.qpos[:4] = tilted(tilt)
    data.qvel[:3] = [across, 0.0, spin_rad_s]
    time_s, reading = recorded(model, data, 20.0)
    effects = {"lever_arm": {"offset_m": (0.3, -0.2)}, "housing_spin": {"rate_deg_s": np.degrees(spin_rad_s)}}
    found = predicted(TwinRig(LENGTH_M, POSITION_M), effects, [tilt, 0.0, 0.0, across, 0.0], time_s)
    assert found == pytest.approx(reading, abs=5e-5)


def test_double_pendulum_agrees_with_mujoco() -> None:
    upper, lower, ratio = 7.0, 2.0, 0.15
    model, data = engine(BELOW.format(upper=upper, lower=lower), upper, ratio)
    data.qpos[:4], data.qpos[4:8] = tilted(0.08), tilted(0.05)
    time_s, reading = recorded(model, data, 20.0)
    effects = {"double_pendulum": {"rigging_length_m": lower, "hook_mass_ratio": ratio}}
    start = [0.08, 0, 0, 0, 0, 0.13, 0, 0, 0]
    found = predicted(TwinRig(upper + lower, POSITION_M), effects, start, time_s)
    assert found == pytest.approx(reading, abs=3e-5)
