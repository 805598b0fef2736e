"""Bodies and ropes from which the cranes are put together."""

import numpy as np

from tests.working_crane.real.engine import PRESCRIBED_KG
from tests.working_crane.real.rig import G_M_S2, Rope

TINY_KG_M2 = 1e-6
AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def pivot(content: str, axes: str = "xy") -> str:
    """A body on driven slides that carries the sites of the ropes' upper ends."""
    slides = "".join(f'<joint name="{a}" type="slide" axis="{AXES[a]}" armature="{PRESCRIBED_KG}"/>' for a in axes)
    return f'<body name="carrier">{slides}{inertia(1.0)}{content}</body>'


def inertia(mass_kg: float, place: str = "0 0 0", diagonal: str | None = None) -> str:
    """The mass of a body about its centre."""
    return f'<inertial pos="{place}" mass="{mass_kg}" diaginertia="{diagonal or " ".join([str(TINY_KG_M2)] * 3)}"/>'


def site(name: str, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> str:
    """A named point of a body."""
    return f'<site name="{name}" pos="{x_m} {y_m} {z_m}"/>'


def point(name: str, mass_kg: float, x_m: float, z_m: float) -> str:
    """A point mass that moves and does not turn; its site has its name."""
    slides = "".join(f'<joint name="{name}_{a}" type="slide" axis="{AXES[a]}"/>' for a in "xyz")
    return f'<body name="{name}" pos="{x_m} 0 {z_m}">{slides}{inertia(mass_kg)}{site(name)}</body>'


def point_damping(name: str, mass_kg: float, length_m: float, ratio: float) -> dict[str, float | tuple[float, ...]]:
    """Drag of a point mass in proportion to its velocity, as share of the critical damping of its swing."""
    drag = 2 * ratio * mass_kg * float(np.sqrt(G_M_S2 / length_m))
    return {f"{name}_{a}": drag for a in "xyz"}


def hook_damping(hook_kg: float, drag_1_s: float) -> dict[str, float | tuple[float, ...]]:
    """Drag of a hook per its mass: friction in bearings and slings takes its fast mode above the load away."""
    return {f"hook_{axis}": drag_1_s * hook_kg for axis in "xyz"}


def hung(name: str, sites: tuple[str, ...], length_m: float, load_kg: float, bounce_hz: float, falls: int = 0) -> Rope:
    """Return a rope on which this load goes up and down at `bounce_hz`; without tension it is shorter by the sag."""
    share = max(falls, 1)
    stiffness = load_kg * (2 * np.pi * bounce_hz) ** 2 / share**2
    rest_m = length_m - load_kg / share * G_M_S2 / stiffness
    damping = 2 * 0.015 * np.sqrt(stiffness * load_kg / share**2)
    return Rope(name, sites, float(rest_m), float(stiffness * rest_m), float(damping), falls)
