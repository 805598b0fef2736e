"""Kind a: a rope with mass, started and stopped abruptly, so that waves run along it."""

import numpy as np

from tests.working_crane.real.bodies import inertia, pivot, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.rig import G_M_S2, Place, Rig

LINKS = 18


def chain(length_m: float, rope_kg: float, load_kg: float, links: int = LINKS) -> str:
    """Return rigid links on universal joints; each carries half of its mass at either end, the last one the load."""
    link_m, node_kg = length_m / links, rope_kg / links
    inner = site("load", z_m=-link_m)
    for link in reversed(range(links)):
        mass = load_kg + node_kg / 2 if link == links - 1 else node_kg
        place = f"0 0 {-link_m if link else 0.0}"
        inner = (
            f'<body name="link{link}" pos="{place}"><joint name="link{link}x" type="hinge" axis="1 0 0"/>'
            f'<joint name="link{link}y" type="hinge" axis="0 1 0"/>'
            f"{inertia(mass, f'0 0 {-link_m}')}{site(f'node{link}')}{inner}</body>"
        )
    return inner


def heavy_rope(draw: Draw) -> Rig:
    """Draw a light or a heavy load on a rope of 1.2 to 3 kg/m; the housing above a node, near top, middle or load."""
    length_m, rope_kg_m = draw.uniform(12, 35), draw.uniform(1.2, 3.0)
    load_kg = draw.log_uniform(250, 1000) if draw.variant % 2 else draw.log_uniform(800, 4000)
    rope_kg = rope_kg_m * length_m
    rho = draw.uniform(0.1, 0.93)
    link_m = length_m / LINKS
    carrier = min(int(rho * LINKS), LINKS - 1)
    below = f"node{carrier + 1}" if carrier < LINKS - 1 else "load"
    clamp_m = (carrier + 1) * link_m - rho * length_m
    tension_n = (load_kg + rope_kg / 2) * G_M_S2
    moves = draw.work(length_m, {"x": 0.5, "y": 0.5}, ramp_periods=(0.06, 0.35), brake=0.3)
    bending = draw.log_uniform(0.015, 0.06) * tension_n * link_m * np.sqrt(rope_kg_m * length_m**2 / tension_n)
    return Rig(
        bodies=pivot(site("pivot") + chain(length_m, rope_kg, load_kg)),
        ropes=(),
        place=Place(f"node{carrier}", below, above_end_m=clamp_m),
        moves=draw.commanded(moves, 0.12),
        mass_damping_1_s=2 * draw.uniform(0.001, 0.005) * float(np.sqrt(G_M_S2 / length_m)),
        damping={f"link{link}{axis}": bending for link in range(1, LINKS) for axis in "xy"},
        facts={
            "above_end_m": (1 - rho) * length_m,
            "rope_kg_m": rope_kg_m,
            "load_kg": load_kg,
            "string_hz": float(np.sqrt(tension_n / rope_kg_m) / (2 * length_m)),
        },
    )
