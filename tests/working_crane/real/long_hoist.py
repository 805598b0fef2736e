"""Kind e: hoists from 10 to 4 m and back while the load swings and the pivot travels; the rope walks on its drum."""

from tests.working_crane.real.draw import Draw
from tests.working_crane.real.moves import Move
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.rig import Rig

LONGEST_M, SHORTEST_M = 10.0, 4.0
CREEP = 0.12


def long_hoist(draw: Draw) -> Rig:
    """Draw hoists over the whole range, one after another, and drives beside them."""
    load_kg, above_m = draw.log_uniform(500, 5000), draw.uniform(0.7, 3.0)
    walk = draw.sign() * draw.uniform(0.03, 0.3) / (LONGEST_M - SHORTEST_M)
    parts = one_rope(draw, LONGEST_M, load_kg, above_m, bounce_hz=draw.uniform(1.5, 4.0))
    drives = draw.work(7.0, {"x": 0.6, "y": 0.4}, accel_m_s2=(0.06, 0.24), ramp_periods=(0.2, 1.0), fastest_m_s=0.6)
    return Rig(
        bodies=parts.bodies,
        ropes=parts.ropes,
        place=parts.place,
        moves=draw.commanded([*_hoists(draw), *drives], draw.uniform(0.08, 0.2), walk),
        damping=parts.damping,
        facts={"above_end_m": above_m, "load_kg": load_kg, "walk_m": walk * (LONGEST_M - SHORTEST_M)},
    )


def _hoists(draw: Draw) -> list[Move]:
    """Return hoists up and down in turn, each over the whole range."""
    hoists: list[Move] = []
    now_s, way_m = draw.uniform(8, 18), SHORTEST_M - LONGEST_M
    while True:
        speed, ramp_s = draw.uniform(0.22, 0.6), draw.uniform(0.7, 1.5)
        brake = float(draw.rng.choice([0.0, CREEP]))
        hold_s = abs(way_m) / speed - ramp_s
        move = Move("hoist", now_s, speed if way_m > 0 else -speed, ramp_s, hold_s, brake)
        missing_m = way_m - move.way
        move = Move("hoist", now_s, move.speed, ramp_s, hold_s + missing_m / move.speed, brake)
        if move.end_s > draw.duration_s - 1:
            return hoists
        hoists.append(move)
        now_s, way_m = move.end_s + draw.uniform(2, 14), -way_m
