"""Bodies in MuJoCo, driven joint by joint, with ropes whose rest lengths are commanded."""

from dataclasses import dataclass

import mujoco
import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.moves import Moves
from tests.working_crane.real.rig import G_M_S2, Outside, Rig, Rope

PRESCRIBED_KG = 1e13
"""Inertia of driven joints: the load does not show in them."""
SETTLE_S = 14.0
SETTLE_1_S = 1.3
"""Decay of all velocities while the bodies find their rest."""
LIMIT_N = 1e9
UNSTABLE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


@dataclass(frozen=True, slots=True)
class Trace:
    """Places at every step."""

    step_s: float
    sites: dict[str, Array]
    """World axes, m, shape (n, 3)."""
    rest: dict[str, Array]
    """The same before anything moves, shape (3,)."""
    pose: Array | None
    """Axes of the housing's body as columns, shape (n, 3, 3)."""
    rest_pose: Array | None
    touched: Array
    """Whether a body touches the ground or a snag pulls."""
    accelerometer_m_s2: Array | None = None
    """The engine's own, where the housing sits on a body, shape (n, 3)."""


def model_xml(rig: Rig, step_s: float) -> str:
    """Return the model in MuJoCo's language."""
    tendons = "".join(
        f'<spatial name="{rope.name}">{"".join(f"<site site={chr(34)}{s}{chr(34)}/>" for s in rope.sites)}</spatial>'
        for rope in rig.ropes
    )
    actuators = "".join(
        f'<general name="{rope.name}" tendon="{rope.name}" gaintype="fixed" biastype="affine" gainprm="1" '
        f'biasprm="0 0 {-rope.damping_n_s_m}" forcelimited="true" forcerange="{-LIMIT_N} 0"/>'
        for rope in rig.ropes
    )
    sensors = "".join(f'<framepos name="{s}" objtype="site" objname="{s}"/>' for s in recorded_sites(rig))
    if rig.place.body_site is not None:
        sensors += "".join(
            f'<frame{a}axis name="pose_{a}" objtype="site" objname="{rig.place.body_site}"/>' for a in "xyz"
        )
        sensors += f'<accelerometer site="{rig.place.body_site}"/>'
    return f"""<mujoco>
  <option timestep="{step_s!r}" gravity="0 0 {-G_M_S2}" integrator="RK4"/>
  <worldbody>{rig.bodies}</worldbody>
  <tendon>{tendons}</tendon><actuator>{actuators}</actuator><sensor>{sensors}</sensor>
</mujoco>"""


def recorded_sites(rig: Rig) -> tuple[str, ...]:
    """Return the names of the sites whose places are recorded."""
    place = rig.place
    names = [*rig.pivots, rig.end, rig.load, place.top, place.bottom, *rig.sites]
    return tuple(dict.fromkeys([*names, *([place.body_site] if place.body_site else [])]))


def simulate(rig: Rig, step_s: float, steps: int) -> Trace:
    """Return the motion from rest; the moves have a row at each half step."""
    model, data, drive = at_rest(rig, step_s)
    names = recorded_sites(rig)
    rows = np.empty((steps, model.nsensordata))
    touched = np.zeros(steps, dtype=bool)
    rest = data.sensordata.copy()
    for joint, push in rig.push.items():
        first = model.joint(joint).dofadr[0]
        data.qvel[first : first + len(push)] = push
    drive.resting = False
    mujoco.set_mjcb_control(drive)
    try:
        for index in range(steps):
            mujoco.mj_step(model, data)  # evaluates the sensors before it steps
            rows[index] = data.sensordata
            touched[index] = data.ncon > 0 or bool(getattr(drive.outside, "pulls", False))
    finally:
        mujoco.set_mjcb_control(None)
    if any(data.warning[kind].number for kind in UNSTABLE):
        raise RuntimeError(f"the engine lost the motion after {data.time:.1f} s")
    places = {name: rows[:, 3 * i : 3 * i + 3] for i, name in enumerate(names)}
    rests = {name: rest[3 * i : 3 * i + 3] for i, name in enumerate(names)}
    pose = rest_pose = accelerometer = None
    if rig.place.body_site is not None:
        after = 3 * len(names)
        pose = rows[:, after : after + 9].reshape(-1, 3, 3).transpose(0, 2, 1)
        rest_pose = rest[after : after + 9].reshape(3, 3).T
        accelerometer = rows[:, after + 9 :]
    return Trace(step_s, places, rests, pose, rest_pose, touched, accelerometer)


def at_rest(rig: Rig, step_s: float) -> tuple[mujoco.MjModel, mujoco.MjData, "Drive"]:
    """Return the model and the state in which all bodies hang or stand still, at time 0."""
    model = mujoco.MjModel.from_xml_string(model_xml(rig, step_s))
    data = mujoco.MjData(model)
    for joint, value in rig.damping.items():
        first = model.joint(joint).dofadr[0]
        values = np.atleast_1d(value)
        model.dof_damping[first : first + len(values)] = values
    drive = Drive(model, rig)
    mujoco.set_mjcb_control(drive)
    try:
        for _ in range(round(SETTLE_S / step_s)):
            mujoco.mj_step(model, data)
            data.qvel *= 1 - SETTLE_1_S * step_s
        data.qvel[:] = 0.0
        data.time = 0.0
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mjcb_control(None)
    return model, data, drive


class Drive:
    """What the engine calls in each stage: driven joints, winches, forces from outside."""

    def __init__(self, model: mujoco.MjModel, rig: Rig) -> None:
        self._model = model
        self.resting = True
        moves = rig.moves
        self._dofs = np.array([model.joint(name).dofadr[0] for name in rig.driven], dtype=int)
        accelerations = np.zeros((len(moves.time_s), len(rig.driven)))
        for column, name in enumerate(rig.driven):
            accelerations[:, column] = moves.acceleration(name)
            if rig.pivot_path is not None and name in "xyz":
                accelerations[:, column] += rig.pivot_path[:, "xyz".index(name)]
        self._forces: Array = PRESCRIBED_KG * accelerations
        self._ctrl, self._stiffness = _commands(rig.ropes, moves)
        self._last = len(moves.time_s) - 1
        self._half_steps_per_s = 2 / float(model.opt.timestep)
        self.outside: Outside | None = None if rig.outside is None else rig.outside(model, moves.time_s)
        self._mass_damping = rig.mass_damping_1_s
        self._free = np.setdiff1d(np.arange(model.nv), self._dofs)
        self._momentum, self._speed = np.zeros(model.nv), np.zeros(model.nv)

    def __call__(self, _model: mujoco.MjModel, data: mujoco.MjData) -> None:
        stage = 0 if self.resting else min(round(data.time * self._half_steps_per_s), self._last)
        if self._mass_damping:
            self._speed[self._free] = data.qvel[self._free]
            mujoco.mj_mulM(self._model, data, self._momentum, self._speed)
            data.qfrc_applied[self._free] = -self._mass_damping * self._momentum[self._free]
        data.qfrc_applied[self._dofs] = self._forces[stage]
        if len(self._ctrl[0]):
            data.ctrl[:] = self._ctrl[stage]
            self._model.actuator_biasprm[:, 1] = self._stiffness[stage]
        if self.outside is not None:
            self.outside(data, stage)


def _commands(ropes: tuple[Rope, ...], moves: Moves) -> tuple[Array, Array]:
    """Return control and (negative) stiffness of each rope: tension = EA (length/rest - 1) + c (rate - paid-out rate)."""
    control, stiffness = np.zeros((2, len(moves.time_s), len(ropes)))
    paid_m, speed = moves.paid_out_m, moves.velocity("hoist")
    for column, rope in enumerate(ropes):
        control[:, column] = rope.axial_n + rope.damping_n_s_m * rope.falls * speed
        stiffness[:, column] = -rope.axial_n / (rope.rest_m + rope.falls * paid_m)
    return control, stiffness
