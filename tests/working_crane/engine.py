"""The working crane in MuJoCo: a pivot on slides, a rope on a ball joint that is paid out at its top, a load.

Prescribed motions (pivot, rope) move joints of an inertia so large that the load does not show in them. All forces are
evaluated at the times of the Runge-Kutta stages.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from tests.blind.engine import LOAD_KG, MASSLESS_KG, POINT_KG_M2, PRESCRIBED_KG
from tests.blind.mechanics import Array
from tests.working_crane.commands import Commands
from tests.working_crane.crane import G_M_S2, Crane

STEP_S = 0.01
HEAVY_ROPE_STEP_S = 0.005


@dataclass(frozen=True, slots=True)
class Motion:
    """One row per engine step."""

    force_m_s2: Array
    """Specific force at the housing, in a frame along the rope that does not turn about it, shape (n, 3)."""
    direction: Array
    """Unit vector down the rope at the housing, world axes, shape (n, 3)."""
    direction_rate: Array
    """Its derivative, 1/s."""
    rigging: Array
    """Unit vector from hook to load; without a hook that of the rope."""
    paid_out_m: Array
    rate_rad_s: Array
    """Angular rate of the housing in the frame of `force_m_s2`, shape (n, 3)."""


def step_s(crane: Crane) -> float:
    """Return the engine's step; a string needs a shorter one."""
    return STEP_S if crane.rope is None else HEAVY_ROPE_STEP_S


def simulate(
    crane: Crane, given: Commands, tilt_rad: tuple[float, float], rigging_tilt_rad: tuple[float, float] = (0.0, 0.0)
) -> Motion:
    """Return the motion from rest; `given` has a row at each half step, and the motion a row at every second of them."""
    model = mujoco.MjModel.from_xml_string(model_xml(crane))
    data = mujoco.MjData(model)
    _set_start(model, data, tilt_rad, rigging_tilt_rad)
    count = (len(given.time_s) + 1) // 2
    rows = np.empty((count, model.nsensordata))
    mujoco.set_mjcb_control(_forces(model, data, crane, given))
    try:
        for row in rows:
            mujoco.mj_step(model, data)  # evaluates the sensors before it steps
            row[:] = data.sensordata
    finally:
        mujoco.set_mjcb_control(None)
    force, up, spin, rigging_up, paid_out, rate = np.split(rows, [3, 6, 9, 12, 13], axis=1)
    return Motion(force, -up, -np.cross(spin, up), -rigging_up, paid_out[:, 0], rate)


def model_xml(crane: Crane) -> str:
    """Return the bodies in MuJoCo's own language."""
    axes = ("1 0 0", "0 1 0", "0 0 1")
    slides = "".join(
        f'<joint name="pivot{i}" type="slide" axis="{a}" armature="{PRESCRIBED_KG}"/>' for i, a in enumerate(axes)
    )
    rope = _light_rope(crane) if crane.rope is None else _heavy_rope(crane)
    return f"""<mujoco>
  <option timestep="{step_s(crane)}" gravity="0 0 {-G_M_S2}" integrator="RK4"/>
  <worldbody><body name="pivot">{slides}{_point(MASSLESS_KG)}
    <body name="rope"><joint name="swing" type="ball"/>{_point(MASSLESS_KG)}
      {rope}
    </body>
  </body></worldbody>
  <sensor>
    <accelerometer site="housing"/><framezaxis objtype="site" objname="housing"/>
    <frameangvel objtype="site" objname="housing"/><framezaxis objtype="xbody" objname="load"/>
    <jointpos joint="paid_out"/><gyro site="housing"/>
  </sensor>
</mujoco>"""


def _light_rope(crane: Crane) -> str:
    hook = crane.hook
    rope_m = crane.length_m - (0.0 if hook is None else hook.rigging_length_m)
    site = _housing(crane.length_m - crane.above_load_m - rope_m)
    if hook is None:
        return f'<body name="load" pos="0 0 {-rope_m}">{_PAID_OUT}{_point(LOAD_KG)}{site}</body>'
    load = f'<body name="load"><joint type="ball"/>{_point(LOAD_KG, -hook.rigging_length_m)}</body>'
    return f'<body name="hook" pos="0 0 {-rope_m}">{_PAID_OUT}{_point(hook.mass_ratio * LOAD_KG)}{site}{load}</body>'


def _heavy_rope(crane: Crane) -> str:
    """Rigid links without mass, equal point masses where they meet, half a mass at each end of the rope."""
    assert crane.rope is not None
    links = crane.rope.links
    link_m, node_kg = crane.length_m / links, crane.rope.mass_ratio * LOAD_KG / links
    carrier, rest_m = divmod(crane.length_m - crane.above_load_m, link_m)
    inner = ""
    for link in reversed(range(links)):  # from the load up: what hangs at the end of each link
        last, name = link == links - 1, "load" if link == links - 1 else f"node{link}"
        joint = _PAID_OUT if link == 0 else ""
        site = _housing(link_m - rest_m, upward=True) if link == carrier else ""
        mass = _point(LOAD_KG + node_kg / 2 if last else node_kg)
        end = f'<body name="{name}" pos="0 0 {-link_m}">{joint}{mass}{site}{inner}</body>'
        inner = end if link == 0 else f'<body name="link{link}"><joint type="ball"/>{_point(MASSLESS_KG)}{end}</body>'
    return inner


_PAID_OUT = f'<joint name="paid_out" type="slide" axis="0 0 -1" armature="{PRESCRIBED_KG}"/>'


def _housing(depth_m: float, *, upward: bool = False) -> str:
    """The housing below (or above) the end of what carries it."""
    return f'<site name="housing" pos="0 0 {depth_m if upward else -depth_m}"/>'


def _point(mass_kg: float, height_m: float = 0.0) -> str:
    inertia = " ".join([str(POINT_KG_M2)] * 3)
    return f'<inertial pos="0 0 {height_m}" mass="{mass_kg}" diaginertia="{inertia}"/>'


def _forces(
    model: mujoco.MjModel, data: mujoco.MjData, crane: Crane, given: Commands
) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """Return what the engine calls in each stage: prescribed accelerations, wind, damping against the pivot."""
    first, paid_out = model.joint("pivot0").dofadr[0], model.joint("paid_out").dofadr[0]
    load = model.body("load").id
    hanging_kg = float(model.body_mass.sum())
    nodes = [
        (body, float(model.body_mass[body]), _damping(crane, body == load))
        for body in range(1, model.nbody)
        if model.body_mass[body] > 2 * MASSLESS_KG
    ]
    pivot_n: Array = PRESCRIBED_KG * given.pivot_m_s2
    hoist_n: Array = PRESCRIBED_KG * given.hoist_m_s2 - hanging_kg * G_M_S2
    wind_n: Array = LOAD_KG * given.wind_m_s2
    half_steps_per_s = 2 / float(model.opt.timestep)
    velocity, of_body = np.empty(6), mujoco.mjtObj.mjOBJ_BODY
    last = len(given.time_s) - 1

    # Views of the engine's own arrays: to look them up in each stage would take as long as the stage.
    of_bodies_n, of_joints_n = data.xfrc_applied, data.qfrc_applied
    of_pivot_n, pivot_speed, of_load_n = (
        of_joints_n[first : first + 3],
        data.qvel[first : first + 3],
        of_bodies_n[load, :3],
    )
    damped = [(body, -damping * mass, of_bodies_n[body, :3]) for body, mass, damping in nodes]
    linear = velocity[3:]

    def apply(_model: mujoco.MjModel, _data: mujoco.MjData) -> None:
        stage = min(round(data.time * half_steps_per_s), last)
        of_pivot_n[:] = pivot_n[stage]
        of_joints_n[paid_out] = hoist_n[stage]
        for body, factor, force_n in damped:
            mujoco.mj_objectVelocity(model, data, of_body, body, velocity, 0)
            np.multiply(factor, linear - pivot_speed, out=force_n)
        of_load_n[:] += wind_n[stage]

    return apply


def _damping(crane: Crane, is_load: bool) -> float:
    """Return force per mass and velocity, 1/s."""
    if is_load:
        return 2 * crane.damping_ratio * crane.rate_rad_s
    return 0.0 if crane.rope is None else crane.rope.damping_1_s


def _set_start(
    model: mujoco.MjModel, data: mujoco.MjData, tilt_rad: tuple[float, float], rigging_tilt_rad: tuple[float, float]
) -> None:
    rope = _lean(tilt_rad)
    swing = model.joint("swing").qposadr[0]
    data.qpos[swing : swing + 4] = rope
    if any(rigging_tilt_rad):
        rigging = _lean((tilt_rad[0] + rigging_tilt_rad[0], tilt_rad[1] + rigging_tilt_rad[1]))
        inverse, relative = np.empty(4), np.empty(4)
        mujoco.mju_negQuat(inverse, rope)
        mujoco.mju_mulQuat(relative, inverse, rigging)
        joint = model.jnt_qposadr[model.body("load").jntadr[0]]
        data.qpos[joint : joint + 4] = relative


def _lean(tilt_rad: tuple[float, float]) -> Array:
    """Return the pose of a rope that leans toward world x and y, not turned about itself."""
    up = np.array([-np.tan(tilt_rad[0]), -np.tan(tilt_rad[1]), 1.0])
    pose = np.empty(4)
    mujoco.mju_quatZ2Vec(pose, up / np.linalg.norm(up))
    return pose
