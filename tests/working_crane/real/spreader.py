"""Kind d: a container spreader on four ropes that converge downwards; the housing on the spreader or on one rope."""

import numpy as np

from tests.working_crane.real.bodies import hung, inertia, pivot, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.reeving import CORNERS
from tests.working_crane.real.rig import G_M_S2, Place, Rig, Rope
from tests.working_crane.real.turbulence import blown, wind_m_s

LOAD_SIZE_M = (2.4, 6.1, 2.6)
"""Of a container of twenty feet; the short side lies along the trolley's way x."""
LOAD_BELOW_M = 1.5
"""The middle of container and spreader below the corners."""


def spreader_body(mass_kg: float, block_m: tuple[float, float], eccentric_m: tuple[float, float], down_m: float) -> str:
    """A spreader locked to a container, as one rigid body; its origin lies between the four corners."""
    x, y, z = np.square(LOAD_SIZE_M) * mass_kg / 12
    middle = f"{eccentric_m[0]} {eccentric_m[1]} {-LOAD_BELOW_M}"
    corners = "".join(
        site(f"corner{i}", sx * block_m[0] / 2, sy * block_m[1] / 2) for i, (sx, sy) in enumerate(CORNERS)
    )
    return (
        f'<body name="spreader" pos="0 0 {-down_m}"><freejoint name="spreader"/>'
        f"{inertia(mass_kg, middle, f'{y + z} {x + z} {x + y}')}{site('spreader')}{corners}"
        f"{site('load', eccentric_m[0], eccentric_m[1], -LOAD_BELOW_M)}"
    )


def four_ropes(
    length_m: float, top_m: tuple[float, float], block_m: tuple[float, float], load_kg: float, bounce_hz: float
) -> tuple[tuple[Rope, ...], str]:
    """Return four ropes from the corners at the trolley to those of the spreader, and the sites at the trolley."""
    inward = np.hypot(top_m[0] - block_m[0], top_m[1] - block_m[1]) / 2
    part_m = float(np.hypot(length_m, inward))
    one = hung("rope", (), part_m, load_kg / 4, bounce_hz)
    ropes = [
        Rope(f"rope{i}", (f"top{i}", f"corner{i}"), one.rest_m, one.axial_n, one.damping_n_s_m, 1) for i in range(4)
    ]
    top = "".join(site(f"top{i}", sx * top_m[0] / 2, sy * top_m[1] / 2) for i, (sx, sy) in enumerate(CORNERS))
    return tuple(ropes), top


def spreader(draw: Draw) -> Rig:
    """Draw: housing on one rope, housing on the spreader, eccentric load with skew and the housing on one rope."""
    on_block, skewed = draw.variant % 3 == 1, draw.variant % 3 == 2
    length_m = draw.uniform(9, 22)
    top_m = (draw.uniform(1.5, 2.6), draw.uniform(4.2, 5.2))
    block_m = (draw.uniform(0.62, 0.85) * top_m[0], draw.uniform(0.8, 0.92) * top_m[1])
    load_kg = draw.log_uniform(6000, 32000)
    side_m = draw.uniform(0.15, 0.35) if skewed else draw.uniform(0.0, 0.06)
    eccentric_m = (0.3 * side_m * draw.sign(), side_m * draw.sign())
    ropes, top = four_ropes(length_m, top_m, block_m, load_kg, draw.uniform(1.6, 3.5))
    above_m = 0.3 if on_block else draw.uniform(0.8, 2.5)
    moves = draw.work(
        length_m, {"x": 0.62, "y": 0.1, "hoist": 0.28}, bounds_m=(0.75 * length_m, 1.25 * length_m),
        accel_m_s2=(0.08, 0.36), ramp_periods=(0.2, 0.75),
    )  # fmt: skip
    windy, ratio = draw.chance(0.5), draw.uniform(0.001, 0.004)
    mean_m_s, area_m2 = draw.uniform(2, 6) if windy else 0.0, draw.uniform(10, 18)
    wind = wind_m_s(draw.rng, draw.time_s, mean_m_s) if windy else None
    drag = 2 * ratio * load_kg * float(np.sqrt(G_M_S2 / length_m))
    housing = site("housing", draw.uniform(-0.3, 0.3), draw.uniform(-0.3, 0.3), 0.3)
    return Rig(
        bodies=pivot(site("pivot") + top)
        + spreader_body(load_kg, block_m, eccentric_m, length_m)
        + housing
        + "</body>",
        ropes=ropes,
        place=Place("top0", "corner0", above_m, body_site="housing" if on_block else None, leans_by_design=True),
        moves=draw.commanded(moves, 0.25),
        end="spreader",
        damping={"spreader": (drag,) * 3 + (0.5 * drag, 0.5 * drag, 2 * drag)},
        push={"spreader": (0.0, 0.0, 0.0, 0.0, 0.0, draw.sign() * draw.uniform(0.01, 0.03))} if skewed else {},
        outside=None if wind is None else blown("spreader", wind.velocity_m_s, area_m2),
        gust=None if wind is None else wind.gust,
        facts={
            "above_end_m": above_m,
            "load_kg": load_kg,
            "eccentric_m": side_m,
            "top_m": top_m,
            "block_m": block_m,
            "on_block": on_block,
            "wind_m_s": mean_m_s,
        },
    )
