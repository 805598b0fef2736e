"""Kind i: a pivot that never rests: a gantry on a yielding portal, a crane on a barge."""

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.bodies import AXES, inertia, site
from tests.working_crane.real.draw import LEAD_IN_S, Draw
from tests.working_crane.real.engine import PRESCRIBED_KG
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.rig import Rig

COMPONENTS = 40
"""Waves of an irregular sea."""


def moving_base(draw: Draw) -> Rig:
    """Draw in turn: yielding portal, regular sea, irregular sea."""
    return gantry(draw) if draw.variant % 3 == 0 else barge(draw, irregular=draw.variant % 3 == 2)


def portal(mass_kg: float, frequency_hz: float) -> str:
    """A driven travel along x and y, and a mass on springs along x on it that carries the pivot."""
    driven = "".join(f'<joint name="{a}" type="slide" axis="{AXES[a]}" armature="{PRESCRIBED_KG}"/>' for a in "xy")
    stiffness = mass_kg * (2 * np.pi * frequency_hz) ** 2
    spring = f'<joint name="yield" type="slide" axis="1 0 0" stiffness="{stiffness}"/>'
    inner = f'<body name="portal">{spring}{inertia(mass_kg)}{site("pivot")}</body>'
    return f'<body name="carrier">{driven}{inertia(1.0)}{inner}</body>'


def gantry(draw: Draw) -> Rig:
    """A portal that yields along its travel at 0.5 to 1.5 Hz."""
    length_m, load_kg = draw.uniform(7, 20), draw.log_uniform(1500, 10000)
    above_m, frequency_hz = draw.uniform(0.12, 0.7) * length_m, draw.uniform(0.5, 1.5)
    slings = (draw.uniform(1.5, 3.0), draw.uniform(0.06, 0.14)) if draw.chance(0.5) else None
    portal_kg = draw.uniform(2.0, 6.0) * load_kg
    parts = one_rope(
        draw, length_m, load_kg, above_m, bounce_hz=draw.uniform(2.0, 4.5), slings=slings,
        carrier=portal(portal_kg, frequency_hz),
    )  # fmt: skip
    axes = {"x": 0.6, "y": 0.2, "hoist": 0.38}
    moves = draw.work(length_m, axes, bounds_m=(max(0.75 * length_m, above_m + 1), 1.25 * length_m))
    damping = 2 * draw.uniform(0.02, 0.04) * portal_kg * 2 * np.pi * frequency_hz
    return Rig(
        bodies=parts.bodies,
        ropes=parts.ropes,
        place=parts.place,
        moves=draw.commanded(moves, 0.2),
        end=parts.end,
        damping={**parts.damping, "yield": damping},
        facts={
            "above_end_m": above_m,
            "load_kg": load_kg,
            "flex": (portal_kg, frequency_hz),
            "slings": slings,
            "pivot_height_m": None,
        },
    )


def barge(draw: Draw, *, irregular: bool) -> Rig:
    """A crane whose pivot stands 22 to 38 m above the axis of roll; its load swings faster than the sea."""
    length_m, load_kg = draw.uniform(5, 11), draw.log_uniform(1500, 9000)
    above_m, height_m, out_m = draw.uniform(0.12, 0.7) * length_m, draw.uniform(22, 38), draw.uniform(5, 18)
    parts = one_rope(draw, length_m, load_kg, above_m, bounce_hz=draw.uniform(1.5, 4.0), axes="xyz")
    wave_hz = draw.uniform(0.08, 0.11)
    roll = np.radians(1.0) * _sea(draw, wave_hz, irregular)
    pitch = np.radians(draw.uniform(0.2, 0.5)) * _sea(draw, wave_hz * draw.uniform(0.85, 1.15), irregular)
    heave_m = draw.uniform(0.1, 0.4) * _sea(draw, wave_hz * draw.uniform(0.9, 1.3), irregular)
    path = _pivot_m(roll, pitch, heave_m, height_m, out_m)
    half_s = draw.time_s[1] - draw.time_s[0]
    axes = {"x": 0.55, "y": 0.15, "hoist": 0.38}
    moves = draw.work(
        length_m, axes, bounds_m=(max(0.75 * length_m, above_m + 1), 1.25 * length_m), accel_m_s2=(0.08, 0.25)
    )
    return Rig(
        bodies=parts.bodies,
        ropes=parts.ropes,
        place=parts.place,
        moves=draw.commanded(moves, 0.2),
        driven=("x", "y", "z"),
        damping=parts.damping,
        pivot_path=np.gradient(np.gradient(path, half_s, axis=0), half_s, axis=0),
        always_driven=True,
        facts={
            "above_end_m": above_m,
            "load_kg": load_kg,
            "flex": None,
            "slings": None,
            "pivot_height_m": height_m,
            "out_m": out_m,
            "wave_hz": wave_hz,
            "irregular": irregular,
        },
    )


def _sea(draw: Draw, frequency_hz: float, irregular: bool) -> Array:
    """Return a motion of amplitude 1 that begins gently: a sine, or many of a narrow spectrum."""
    time_s = draw.time_s
    part = np.clip((time_s + LEAD_IN_S) / (LEAD_IN_S - 1), 0.0, 1.0)
    rise = part**3 * (10 + part * (6 * part - 15))
    if not irregular:
        sine: Array = rise * np.sin(2 * np.pi * frequency_hz * time_s + draw.uniform(0, 2 * np.pi))
        return sine
    shares = draw.rng.normal(1.0, 0.18, COMPONENTS).clip(0.6, 1.8)
    phases = draw.rng.uniform(0, 2 * np.pi, COMPONENTS)
    waves = [np.sin(2 * np.pi * frequency_hz * s * time_s + p) for s, p in zip(shares, phases, strict=True)]
    return np.asarray(rise * np.sum(waves, axis=0) / np.sqrt(COMPONENTS))


def _pivot_m(roll_rad: Array, pitch_rad: Array, heave_m: Array, height_m: float, out_m: float) -> Array:
    """Return the path of a point of the barge, rolled about x and then pitched about y."""
    y, up = -height_m * np.sin(roll_rad), height_m * np.cos(roll_rad)
    x = out_m * np.cos(pitch_rad) + up * np.sin(pitch_rad)
    z = -out_m * np.sin(pitch_rad) + up * np.cos(pitch_rad) + heave_m
    return np.column_stack([x, y, z])
