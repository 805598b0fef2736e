"""Kind c: a slewing jib with a trolley, or a luffing boom, that yields; the rope's torsion follows it late."""

import numpy as np

from tests.working_crane.real.bodies import hook_damping, hung, inertia, point, point_damping, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.engine import PRESCRIBED_KG
from tests.working_crane.real.rig import Place, Rig

BELOW_JIB_M = 1.0
"""The rope leaves its sheave so far below the axis about which the jib twists."""


def jib(radius_m: float, height_m: float, flex: tuple[float, float, float], inner: str, *, luffing: bool) -> str:
    """Return a driven slewing axis, a driven trolley or boom on it, and a tip that yields across, up and in torsion.

    `flex` is the stiffness across and up in N/m and the moving mass in kg.
    """
    across_n_m, up_n_m, mass_kg = flex
    torsion_n_m = mass_kg * (2 * np.pi * 1.1) ** 2
    springs = (
        f'<joint name="across" type="slide" axis="0 1 0" stiffness="{across_n_m}"/>'
        f'<joint name="up" type="slide" axis="0 0 1" stiffness="{up_n_m}"/>'
        f'<joint name="torsion" type="hinge" axis="1 0 0" stiffness="{torsion_n_m}"/>'
    )
    turning = f"{mass_kg} {mass_kg} {mass_kg}"
    tip = f"{springs}{inertia(mass_kg, '0 0 0', turning)}{site('pivot', z_m=-BELOW_JIB_M)}{inner}"
    base = f'<joint name="slew" type="hinge" axis="0 0 1" armature="{PRESCRIBED_KG}"/>{inertia(1.0)}'
    if luffing:
        boom = f'<joint name="luff" type="hinge" axis="0 -1 0" armature="{PRESCRIBED_KG}"/>{inertia(1.0)}'
        place = f"{radius_m} 0 {height_m}"
        arm = f'<body name="boom">{boom}<body name="tip" pos="{place}">{tip}</body></body>'
        return f'<body name="tower" pos="0 0 {-height_m}">{base}{arm}</body>'
    slide = f'<joint name="trolley" type="slide" axis="1 0 0" armature="{PRESCRIBED_KG}"/>{inertia(1.0)}'
    arm = f'<body name="trolley" pos="{radius_m} 0 {height_m}">{slide}<body name="tip">{tip}</body></body>'
    return f'<body name="tower" pos="0 0 {-height_m}">{base}{arm}</body>'


def slewing(draw: Draw) -> Rig:
    """Draw a jib with a trolley, or in one case of three a luffing boom; the load hangs in slings under a hook."""
    luffing = draw.variant % 3 == 1
    length_m, above_m = draw.uniform(11, 27), draw.uniform(0.12, 0.7)
    load_kg, sling_m, hook_share = draw.log_uniform(800, 5000), draw.uniform(1.5, 3.0), draw.uniform(0.06, 0.14)
    hook_kg = hook_share * load_kg
    radius_m = draw.uniform(14, 32)
    boom_m = radius_m / float(np.cos(draw.uniform(0.75, 1.15)))
    height_m = float(np.sqrt(boom_m**2 - radius_m**2)) if luffing else 0.0
    flex = _flex(draw, load_kg + hook_kg)
    below = _under(radius_m, length_m, sling_m, hook_kg, load_kg)
    axes = {"slew": 0.5, "luff": 0.3, "hoist": 0.35} if luffing else {"slew": 0.55, "trolley": 0.25, "hoist": 0.35}
    moves = draw.work(
        length_m, axes, radius_m=radius_m, bounds_m=(0.8 * length_m, 1.2 * length_m),
        accel_m_s2=(0.06, 0.22) if luffing else (0.08, 0.3), ramp_periods=(0.2, 0.7),
    )  # fmt: skip
    rope = hung("rope", ("pivot", "hook"), length_m, load_kg + hook_kg, draw.uniform(1.5, 4.0), 1)
    sling = hung("sling", ("hook", "load"), sling_m, load_kg, draw.uniform(5, 8))
    ratio, lag_s = draw.uniform(0.001, 0.005), draw.uniform(3, 15)
    damped = 2 * np.sqrt(np.array(flex[:2]) * flex[2]) * draw.uniform(0.01, 0.03)
    return Rig(
        bodies=jib(radius_m, height_m, flex, "", luffing=luffing) + below,
        ropes=(rope, sling),
        place=Place("pivot", "hook", above_end_m=above_m * length_m),
        moves=draw.commanded(moves, 0.25),
        driven=("slew", "luff") if luffing else ("slew", "trolley"),
        end="hook",
        damping={
            "across": float(damped[0]),
            "up": float(damped[1]),
            "torsion": 2 * 0.02 * flex[2] * 2 * np.pi * 1.1,
            **hook_damping(hook_kg, draw.uniform(0.04, 0.12)),
            **point_damping("load", load_kg, length_m, ratio),
        },
        heading_lag_s=lag_s,
        facts={
            "above_end_m": above_m * length_m,
            "radius_m": radius_m,
            "height_m": height_m,
            "luffing": luffing,
            "flex": flex,
            "slings": (sling_m, hook_share),
            "load_kg": load_kg,
            "heading_lag_s": lag_s,
        },
    )


def _flex(draw: Draw, hung_kg: float) -> tuple[float, float, float]:
    """Return the tip's mass, and the stiffness that makes 0.4 to 0.8 Hz across and 0.8 to 1.5 Hz up."""
    mass_kg = draw.uniform(1.0, 2.2) * hung_kg
    across, up = draw.uniform(0.4, 0.8), draw.uniform(0.8, 1.5)
    return mass_kg * (2 * np.pi * across) ** 2, mass_kg * (2 * np.pi * up) ** 2, mass_kg


def _under(radius_m: float, length_m: float, sling_m: float, hook_kg: float, load_kg: float) -> str:
    down_m = BELOW_JIB_M + length_m
    return point("hook", hook_kg, radius_m, -down_m) + point("load", load_kg, radius_m, -down_m - sling_m)
