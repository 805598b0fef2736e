"""A rigid pendulum in MuJoCo: a rod with a bob on a ball joint, an accelerometer beside its line, in a housing that is askew."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from tests.blind.mechanics import Array

GRAVITY_M_S2 = 9.80665
STEPS_PER_PERIOD = 400
SMOOTHING_RAD_S = 1e-3
"""Rate below which dry friction becomes viscous."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidPendulum:
    """What swings, and what hinders it."""

    line_m: float
    """Pivot to the centre of the bob."""
    bob_radius_m: float = 0.0
    rod_mass_ratio: float = 0.0
    """Mass of the rod over that of the bob."""
    sensor_m: float
    """Pivot to the accelerometer, along the line."""
    beside_m: tuple[float, float] = (0.0, 0.0)
    """The accelerometer beside the line, x and y of the housing."""
    damping_ratio: float = 0.0
    drag: float = 0.0
    """Drag per mass is `drag` |v| v over the length of the equivalent pendulum."""
    friction: float = 0.0
    """Dry friction in the pivot: the angle in rad at which it holds the pendulum."""
    wind: tuple[float, float] = (0.0, 0.0)
    """Steady horizontal force on the bob over the weight."""

    @property
    def moments(self) -> tuple[float, float, float]:
        """Mass, first moment and inertia about the pivot, for a bob of 1 kg."""
        rod, line_m = self.rod_mass_ratio, self.line_m
        inertia = line_m**2 * (1 + rod / 3) + 0.4 * self.bob_radius_m**2
        return 1 + rod, line_m * (1 + rod / 2), inertia

    @property
    def equivalent_m(self) -> float:
        """Length of the point pendulum with the same period."""
        _, first, inertia = self.moments
        return inertia / first


@dataclass(frozen=True, slots=True)
class RigidMotion:
    """Specific force at the accelerometer in the housing that is not askew, g, and the angle of the line from the vertical."""

    time_s: Array
    force_g: Array
    angle_rad: Array


def simulate(
    body: RigidPendulum, tilt_rad: float, heading_rad: float, rate_rad_s: float, duration_s: float
) -> RigidMotion:
    """Release at a tilt in a vertical plane, with a rate across the plane."""
    step_s = 2 * np.pi * np.sqrt(body.equivalent_m / GRAVITY_M_S2) / STEPS_PER_PERIOD
    model = mujoco.MjModel.from_xml_string(_xml(body, step_s))
    data = mujoco.MjData(model)
    across = np.array([-np.sin(heading_rad), np.cos(heading_rad), 0.0])
    mujoco.mju_axisAngle2Quat(data.qpos, across, -tilt_rad)
    data.qvel[:] = rate_rad_s * np.array([np.cos(heading_rad), np.sin(heading_rad), 0.0])
    count = int(np.ceil(duration_s / step_s)) + 1
    force, up = np.empty((count, 3)), np.empty(count)
    mujoco.set_mjcb_passive(_hindering(body))
    try:
        for step in range(count):
            up[step] = 1 - 2 * (data.qpos[1] ** 2 + data.qpos[2] ** 2)
            mujoco.mj_step(model, data)
            force[step] = data.sensordata
    finally:
        mujoco.set_mjcb_passive(None)
    return RigidMotion(step_s * np.arange(count), force / GRAVITY_M_S2, np.arccos(np.clip(up, -1, 1)))


def _xml(body: RigidPendulum, step_s: float) -> str:
    mass, first, inertia = body.moments
    centre = first / mass
    across, along = inertia - mass * centre**2 + 1e-9, 1e-6 * inertia + 0.4 * body.bob_radius_m**2
    along = min(along, 1.9 * across)
    x, y = body.beside_m
    return f"""<mujoco><option timestep="{step_s}" gravity="0 0 {-GRAVITY_M_S2}" integrator="RK4"/><worldbody><body>
      <joint type="ball"/><inertial pos="0 0 {-centre}" mass="{mass}" diaginertia="{across} {across} {along}"/>
      <site name="sensor" pos="{x} {y} {-body.sensor_m}"/>
    </body></worldbody><sensor><accelerometer site="sensor"/></sensor></mujoco>"""


def _hindering(body: RigidPendulum) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """Return the torques that the engine asks for in each stage, in the body's axes."""
    _, first, inertia = body.moments
    rate_1_s = np.sqrt(GRAVITY_M_S2 / body.equivalent_m)
    weight = first * GRAVITY_M_S2
    rotation = np.empty(9)

    def push(_model: mujoco.MjModel, data: mujoco.MjData) -> None:
        spin = data.qvel[:3].copy()
        speed = float(np.hypot(spin[0], spin[1]))
        per_rate = 2 * body.damping_ratio * rate_1_s + body.drag * speed
        per_rate += body.friction * rate_1_s**2 / np.hypot(speed, SMOOTHING_RAD_S)
        torque = -inertia * per_rate * spin
        torque[2] = 0.0
        if body.wind != (0.0, 0.0):
            mujoco.mju_quat2Mat(rotation, data.qpos[:4] / np.linalg.norm(data.qpos[:4]))
            force = rotation.reshape(3, 3).T @ np.array([*body.wind, 0.0])
            torque += weight * np.cross([0.0, 0.0, -1.0], force)
        data.qfrc_passive[:3] += torque

    return push
