"""The crane as bodies and joints of MuJoCo: a pivot on slides, a rope on a ball joint, a load on a slide along the rope.

The rope hangs on a ball joint and has no friction about its own axis: what it carries does not turn about it unless it is
given a spin, which then stays. Motions that are prescribed (pivot, length) move joints of an inertia so large that the load
does not show in them. Forces that depend on the velocity are evaluated inside each Runge-Kutta stage.
"""

from collections.abc import Callable

import mujoco
import numpy as np

from tests.blind.contact import Contact
from tests.blind.heavy_rope import RopeDamping, chain_xml, slopes
from tests.blind.mechanics import Array, Mechanics, Motion, Start
from tests.blind.structure import bend, slides_xml

STEP_S = 0.005
COARSE_STEP_S = 0.02
"""Enough for a swing without sharp edges: 1e-7 g."""
LOAD_KG = 1.0
POINT_KG_M2 = 1e-7
"""Turning inertia of what stands for a point; beside mass times length squared it is nothing."""
MASSLESS_KG = 1e-9
HOUSING_KG = 1e-9
"""Of a housing on a clamp that yields."""
ROCKING_DAMPING_RATIO = 0.3
PRESCRIBED_KG = 1e9
"""Inertia of a joint whose motion is prescribed."""


def simulate(mechanics: Mechanics, start: Start, duration_s: float, step_s: float = STEP_S) -> Motion:
    """The motion from 0 to `duration_s`, both ends included, every `step_s`."""
    model = mujoco.MjModel.from_xml_string(model_xml(mechanics, step_s))
    data = mujoco.MjData(model)
    _set_start(model, data, mechanics, start)
    count = round(duration_s / step_s) + 1
    edge_s: Array = step_s * np.arange(count + 1, dtype=np.float64)
    joint_force, load_force = _joint_forces(model, mechanics, edge_s), _load_forces(mechanics, edge_s)
    load, swing = model.body("load").id, model.joint("swing").qposadr[0]
    sensors, quaternions = np.empty((count, 6)), np.empty((count, 4))
    release_step = None if mechanics.release is None else int(np.searchsorted(edge_s, mechanics.release.at_s))
    outer = np.zeros(3)
    ringing = RopeDamping(model, data) if mechanics.rope_kg else None
    contact = None if mechanics.holding is None else Contact(mechanics.holding, mechanics.gravity_m_s2, step_s)
    if mechanics.velocity_force or mechanics.place_force:
        mujoco.set_mjcb_control(_pushing(model, data, load, outer, mechanics))
    try:
        for step in range(count):
            if step == release_step:
                _let_go(model)
            data.qfrc_applied[:] = joint_force[step]
            data.xfrc_applied[load, :3] = outer[:] = load_force[step]
            if ringing is not None:
                data.xfrc_applied[load, :3] = outer[:] = outer + ringing.apply()
            if contact is not None:
                mujoco.mj_kinematics(model, data)
                data.xfrc_applied[load, :3] = outer[:] = outer + LOAD_KG * contact.pull(data.xpos[load])
            quaternions[step] = data.qpos[swing : swing + 4]
            mujoco.mj_step(model, data)  # its sensors tell of the state before the step
            sensors[step] = data.sensordata
    finally:
        mujoco.set_mjcb_control(None)
    share = mechanics.share
    force = (1 - share) * sensors[:, :3] + share * sensors[:, 3:]
    return Motion(edge_s[:-1], force, np.arccos(1 - 2 * (quaternions[:, 1] ** 2 + quaternions[:, 2] ** 2)))


def model_xml(mechanics: Mechanics, step_s: float) -> str:
    """The bodies, in MuJoCo's own language."""
    hook, length_m = mechanics.hook, mechanics.length_m
    rope_m = length_m if hook is None else length_m - hook.rigging_length_m
    if mechanics.release is not None:
        end = _two_parts(length_m, mechanics.release.shift_m)
    elif hook is None:
        end = f'<body name="load">{_load(mechanics)}</body>'
    else:
        below = f'<joint type="ball"/>{_load(mechanics, -hook.rigging_length_m)}'
        end = f'{_point(hook.mass_ratio * LOAD_KG)}<body name="load">{below}</body>'
    if mechanics.rope_kg:
        rope = chain_xml(length_m, mechanics.position_m, mechanics.rope_kg, end)
    else:
        rope = f"""<body name="rope"><joint name="swing" type="ball"/>{_point(MASSLESS_KG)}
      {_housing("on_rope", -mechanics.position_m, mechanics)}
      <body name="end" pos="0 0 {-rope_m}">{_rope_joints(mechanics)}
        {_housing("with_load", rope_m - mechanics.position_m, mechanics)}
        {end}
      </body>
    </body>"""
    return f"""<mujoco>
  <option timestep="{step_s}" gravity="0 0 {-mechanics.gravity_m_s2}" integrator="RK4"/>
  <worldbody><body name="pivot">{_pivot_joints(mechanics)}
    {rope}
  </body></worldbody>
  <sensor><accelerometer site="on_rope"/><accelerometer site="with_load"/></sensor>
</mujoco>"""


def _housing(name: str, height_m: float, mechanics: Mechanics) -> str:
    """The accelerometer, on the rope or on a clamp that yields."""
    x, y = mechanics.beside_m
    clamp = mechanics.clamp
    if clamp is None:
        return f'<site name="{name}" pos="{x} {y} {height_m}"/>'
    joints, across = "", 2 * HOUSING_KG * clamp.below_m**2
    for axis, hz in zip(("1 0 0", "0 1 0"), clamp.rocking_hz or (), strict=False):
        joints += _spring_hinge(axis, across, hz, ROCKING_DAMPING_RATIO)
    if clamp.torsion_hz is not None:
        about_rope = HOUSING_KG * clamp.below_m**2
        hinge = _spring_hinge("0 0 1", about_rope, clamp.torsion_hz, clamp.torsion_damping_ratio)
        joints += hinge.replace("<joint ", f'<joint name="twist_{name}" ')
    inertia = " ".join([str(HOUSING_KG * clamp.below_m**2)] * 3)
    mass = f'<inertial pos="0 0 {-clamp.below_m}" mass="{HOUSING_KG}" diaginertia="{inertia}"/>'
    return f'<body pos="0 0 {height_m}">{joints}{mass}<site name="{name}" pos="{x} {y} 0"/></body>'


def _spring_hinge(axis: str, inertia_kg_m2: float, hz: float, damping_ratio: float) -> str:
    rate = 2 * np.pi * hz
    stiffness, damping = inertia_kg_m2 * rate**2, 2 * damping_ratio * rate * inertia_kg_m2
    return f'<joint type="hinge" axis="{axis}" stiffness="{stiffness}" damping="{damping}"/>'


def _two_parts(length_m: float, shift_m: float) -> str:
    """Two equal masses that together swing as one at `length_m`; the one that stays is `shift_m` further down."""
    stays_m = length_m + shift_m
    goes_m = (length_m + np.sqrt(length_m**2 - 4 * stays_m * shift_m)) / 2  # (stays^2 + goes^2)/(stays + goes) = length
    stays, goes = (f'pos="0 0 {length_m - each_m}">{_point(LOAD_KG / 2)}</body>' for each_m in (stays_m, goes_m))
    return f'<body name="load" {stays}<body name="let_go" {goes}'


def _load(mechanics: Mechanics, height_m: float = 0.0) -> str:
    across = POINT_KG_M2 + LOAD_KG * mechanics.gyration_m**2
    return f'<inertial pos="0 0 {height_m}" mass="{LOAD_KG}" diaginertia="{across} {across} {POINT_KG_M2}"/>'


def _point(mass_kg: float, height_m: float = 0.0) -> str:
    inertia = " ".join([str(POINT_KG_M2)] * 3)
    return f'<inertial pos="0 0 {height_m}" mass="{mass_kg}" diaginertia="{inertia}"/>'


def _pivot_joints(mechanics: Mechanics) -> str:
    if mechanics.structure is None:
        return _driven(mechanics)
    slides, mass_kg = slides_xml(mechanics.structure, hanging_kg(mechanics) * mechanics.gravity_m_s2)
    return _driven(mechanics) + slides + _point(mass_kg)


def _driven(mechanics: Mechanics) -> str:
    if not mechanics.pivot_acceleration:
        return ""
    axes = ("1 0 0", "0 1 0", "0 0 1")
    slides = [
        f'<joint name="pivot{i}" type="slide" axis="{a}" armature="{PRESCRIBED_KG}"/>' for i, a in enumerate(axes)
    ]
    return "".join(slides) + (_point(MASSLESS_KG) if mechanics.structure is None else "")


def _rope_joints(mechanics: Mechanics) -> str:
    """Down the rope: first what is paid out, then what stretches."""
    joints = ""
    if mechanics.length_speed:
        joints += f'<joint name="paid_out" type="slide" axis="0 0 -1" armature="{PRESCRIBED_KG}"/>'
    if mechanics.spring is not None:
        rate, mass = 2 * np.pi * mechanics.spring.frequency_hz, hanging_kg(mechanics)
        damping = 2 * mechanics.spring.damping_ratio * rate * mass
        joints += '<joint name="stretch" type="slide" axis="0 0 -1" '
        joints += f'stiffness="{mass * rate**2}" damping="{damping}"/>'
    return joints


def hanging_kg(mechanics: Mechanics) -> float:
    """Everything below the rope."""
    return LOAD_KG * (1 if mechanics.hook is None else 1 + mechanics.hook.mass_ratio)


def _joint_forces(model: mujoco.MjModel, mechanics: Mechanics, edge_s: Array) -> Array:
    """Forces on the prescribed joints, shape (steps, degrees of freedom): exact for what a step adds to the speed."""
    middle_s = (edge_s[1:] + edge_s[:-1]) / 2
    forces = np.zeros((len(middle_s), model.nv))
    if mechanics.pivot_acceleration:
        first = model.joint("pivot0").dofadr[0]
        forces[:, first : first + 3] = PRESCRIBED_KG * sum(
            profile(middle_s) for profile in mechanics.pivot_acceleration
        )
    if mechanics.length_speed:
        speed = sum(profile(edge_s) for profile in mechanics.length_speed)
        weight = hanging_kg(mechanics) * mechanics.gravity_m_s2
        forces[:, model.joint("paid_out").dofadr[0]] = PRESCRIBED_KG * np.diff(speed) / np.diff(edge_s) - weight
    return forces


def _load_forces(mechanics: Mechanics, edge_s: Array) -> Array:
    """Outer forces on the load, N, shape (steps, 3): the mean of each step."""
    middle_s = (edge_s[1:] + edge_s[:-1]) / 2
    forces = np.zeros((len(middle_s), 3))
    for profile in mechanics.load_acceleration:
        forces += LOAD_KG * profile(middle_s)
    return forces


def _let_go(model: mujoco.MjModel) -> None:
    model.body("let_go").mass[:] = MASSLESS_KG
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _pushing(
    model: mujoco.MjModel, data: mujoco.MjData, load: int, outer: Array, mechanics: Mechanics
) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """What the engine calls in each stage: the step's own force on the load and those that follow from its motion."""
    velocity, body, applied = np.empty(6), mujoco.mjtObj.mjOBJ_BODY, data.xfrc_applied[load, :3]
    rope = model.body("rope").id

    def push(_model: mujoco.MjModel, _data: mujoco.MjData) -> None:
        mujoco.mj_objectVelocity(model, data, body, load, velocity, 0)
        x, y, z = velocity[3:].tolist()
        applied[:] = outer
        for force in mechanics.velocity_force:
            applied[:] += force(x, y, z)
        x, y, z = (data.xipos[load] - data.xpos[rope]).tolist()
        for force in mechanics.place_force:
            applied[:] += force(x, y, z)

    return push


def _set_start(model: mujoco.MjModel, data: mujoco.MjData, mechanics: Mechanics, start: Start) -> None:
    rope, rope_rate = _pose(start.tilt_rad, start.tilt_rate_rad_s, start.heading_rad)
    swing = model.joint("swing")
    data.qpos[swing.qposadr[0] : swing.qposadr[0] + 4] = rope
    spin = np.array([0.0, 0.0, mechanics.spin_rad_s])
    data.qvel[swing.dofadr[0] : swing.dofadr[0] + 3] = _in_body(rope, rope_rate) + spin
    if mechanics.clamp is not None and mechanics.clamp.torsion_hz is not None:
        for name in ("twist_on_rope", "twist_with_load"):
            twist = model.joint(name)
            data.qpos[twist.qposadr[0]], data.qvel[twist.dofadr[0]] = start.twist_rad, start.twist_rate_rad_s
    if mechanics.structure is not None:
        bend(model, data, mechanics.structure, start)
    if mechanics.spring is not None:
        sag_m = mechanics.gravity_m_s2 / (2 * np.pi * mechanics.spring.frequency_hz) ** 2
        data.qpos[model.joint("stretch").qposadr[0]] = sag_m + start.stretch_m
    if mechanics.rope_kg:
        _bend_rope(model, data, mechanics, start)
    if mechanics.hook is not None:
        leans = (start.tilt_rad[0] + start.rigging_tilt_rad[0], start.tilt_rad[1] + start.rigging_tilt_rad[1])
        rigging, rigging_rate = _pose(leans, start.tilt_rate_rad_s, start.heading_rad)
        _turn(model, data, int(model.body("load").jntadr[0]), (rope, rope_rate), (rigging, rigging_rate))


def _bend_rope(model: mujoco.MjModel, data: mujoco.MjData, mechanics: Mechanics, start: Start) -> None:
    """Give the links the shape of the swing, so that the rope hardly rings as a string, and the bow with which it rings."""
    above = None
    shape = slopes(mechanics.length_m, mechanics.position_m, mechanics.rope_kg / LOAD_KG)
    for i, (slope, by_bow) in enumerate(zip(*shape, strict=True)):
        x, y = (float(slope * t + by_bow * b) for t, b in zip(start.tilt_rad, start.bow_m, strict=True))
        x_rate, y_rate = (float(slope * each) for each in start.tilt_rate_rad_s)
        tilt, rate = (x, y), (x_rate, y_rate)
        link = _pose(tilt, rate, start.heading_rad)
        joint = int(model.body(f"rope{i}").jntadr[0])
        _turn(model, data, joint, above or (np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)), link)
        above = link


def _turn(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, above: tuple[Array, Array], below: tuple[Array, Array]
) -> None:
    """Set a ball joint between two bodies by their poses and angular velocities in the world."""
    inverse, relative = np.empty(4), np.empty(4)
    mujoco.mju_negQuat(inverse, above[0])
    mujoco.mju_mulQuat(relative, inverse, below[0])
    place, speed = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    data.qpos[place : place + 4] = relative
    data.qvel[speed : speed + 3] = _in_body(below[0], below[1] - above[1])


def _pose(tilt_rad: tuple[float, float], rate_rad_s: tuple[float, float], heading_rad: float) -> tuple[Array, Array]:
    """Quaternion of a rope's body, and its angular velocity in the world: no turn about the rope."""
    slope = np.tan(tilt_rad)
    slope_rate = np.array(rate_rad_s) * (1 + slope**2)
    down, down_rate = np.array([*slope, -1.0]), np.array([*slope_rate, 0.0])
    size = np.linalg.norm(down)
    n = down / size
    n_rate = (down_rate - n * (n @ down_rate)) / size
    tip, turn, pose = np.empty(4), np.empty(4), np.empty(4)
    mujoco.mju_quatZ2Vec(tip, -n)
    mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), heading_rad)
    mujoco.mju_mulQuat(pose, tip, turn)
    return pose, np.cross(n, n_rate)


def _in_body(pose: Array, world: Array) -> Array:
    inverse, vector = np.empty(4), np.empty(3)
    mujoco.mju_negQuat(inverse, pose)
    mujoco.mju_rotVecQuat(vector, world, inverse)
    return vector
