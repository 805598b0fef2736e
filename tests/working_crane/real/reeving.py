"""Kind b: two or four parts of rope over the sheaves of a hook block, the load in slings under it."""

import numpy as np

from tests.working_crane.real.bodies import hung, inertia, pivot, point, point_damping, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.rig import Place, Rig, Rope

HOOK_M = 0.6
"""From the sheaves' axis down to the hook."""


def block(mass_kg: float, spacing_m: float, gap_m: float, down_m: float) -> str:
    """A hook block with four points where ropes leave its sheaves: across x by the spacing, across y by the gap."""
    turning = f"{0.09 * mass_kg} {0.07 * mass_kg} {0.05 * mass_kg}"
    corners = "".join(site(f"block{i}", sx * spacing_m / 2, sy * gap_m / 2) for i, (sx, sy) in enumerate(CORNERS))
    return (
        f'<body name="block" pos="0 0 {-down_m}"><freejoint name="block"/>{inertia(mass_kg, "0 0 -0.25", turning)}'
        f"{site('block')}{site('hook', z_m=-HOOK_M)}{corners}</body>"
    )


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def falls_of_block(
    *,
    falls: int,
    fixed: bool,
    length_m: float,
    top_m: float,
    block_m: float,
    gap_m: float,
    hung_kg: float,
    bounce_hz: float,
) -> tuple[tuple[Rope, ...], str, float]:
    """Return the ropes, the sites at the top, and the length of one part.

    With two parts both lie in the plane y = 0. A running rope is one rope whose tension is the same in all parts; fixed
    falls are ropes of their own.
    """
    gap_m = gap_m if falls == 4 else 0.0
    top = "".join(site(f"top{i}", sx * top_m / 2, sy * gap_m / 2) for i, (sx, sy) in enumerate(CORNERS))
    part_m = float(np.hypot(length_m, (top_m - block_m) / 2))
    if fixed:
        whole = hung("fall", (), part_m, hung_kg / falls, bounce_hz)
        ropes = [
            Rope(f"fall{i}", (f"top{i}", f"block{i}"), whole.rest_m, whole.axial_n, whole.damping_n_s_m, 1)
            for i in range(falls)
        ]
        return tuple(ropes), top, part_m
    path: tuple[str, ...] = ("top0", "block0", "block1", "top1")
    reeved_m = 2 * part_m + block_m
    if falls == 4:
        path += ("top2", "block2", "block3", "top3")
        reeved_m = 4 * part_m + 2 * block_m + gap_m
    return (hung("rope", path, reeved_m, hung_kg, bounce_hz, falls),), top, part_m


def reeving(draw: Draw) -> Rig:
    """Draw a reeving: two fixed falls, two parts of a running rope, four parts of a running rope."""
    fixed, falls = draw.variant % 3 == 0, 4 if draw.variant % 3 == 2 else 2
    length_m, top_m = draw.uniform(10, 26), draw.uniform(0.45, 1.1)
    block_m, gap_m = draw.uniform(0.4, 0.75) * top_m, draw.uniform(0.2, 0.4)
    block_kg, load_kg = draw.uniform(200, 600), draw.log_uniform(900, 6000)
    sling_m = draw.uniform(1.5, 3.0)
    ropes, top, part_m = falls_of_block(
        falls=falls, fixed=fixed, length_m=length_m, top_m=top_m, block_m=block_m, gap_m=gap_m,
        hung_kg=block_kg + load_kg, bounce_hz=draw.uniform(2.0, 4.5),
    )  # fmt: skip
    sling = hung("sling", ("hook", "load"), sling_m, load_kg, draw.uniform(5, 8))
    rho = draw.uniform(0.12, 0.6)
    moves = draw.work(length_m, {"x": 0.3, "y": 0.35, "hoist": 0.42}, bounds_m=(0.75 * length_m, 1.3 * length_m))
    hook_drag = draw.uniform(0.04, 0.12)
    ratio = draw.uniform(0.001, 0.005)
    return Rig(
        bodies=pivot(site("pivot") + top)
        + block(block_kg, block_m, gap_m if falls == 4 else 0.0, length_m)
        + point("load", load_kg, 0.0, -length_m - HOOK_M - sling_m),
        ropes=(*ropes, sling),
        place=Place("top0", "block0", below_top_m=rho * part_m, leans_by_design=True),
        moves=draw.commanded(moves, 0.2),
        end="block",
        damping={
            "block": (hook_drag * block_kg,) * 3 + (0.06 * block_kg, 0.06 * block_kg, 0.04 * block_kg),
            **point_damping("load", load_kg, length_m, ratio),
        },
        facts={
            "position_m": rho * part_m,
            "falls": falls,
            "ends": fixed,
            "top_m": top_m,
            "block_m": block_m,
            "block_kg": block_kg,
            "load_kg": load_kg,
            "slings": sling_m,
        },
    )
