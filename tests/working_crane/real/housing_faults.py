"""Kind g: an ordinary crane whose housing, sensor or radio misbehaves; the sensor sits beside the rope."""

from tests.working_crane.real.draw import Draw
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.rig import Disturbances, Rig

BESIDE_M = 0.02
"""One sigma per axis."""
TURN_DEG = 20.0


def housing_faults(draw: Draw) -> Rig:
    """Draw in turn: slip and drift, askew with coarse steps and impacts, vibration, radio."""
    length_m, load_kg = draw.uniform(7, 24), draw.log_uniform(600, 5000)
    above_m = draw.uniform(0.1, 0.6) * length_m
    disturbances = _disturbances(draw, above_m)
    parts = one_rope(draw, length_m, load_kg, above_m, bounce_hz=draw.uniform(2.0, 5.0))
    axes = {"x": 0.4, "y": 0.4, "hoist": 0.28}
    moves = draw.work(length_m, axes, bounds_m=(max(0.75 * length_m, above_m + 1), 1.25 * length_m))
    return Rig(
        bodies=parts.bodies,
        ropes=parts.ropes,
        place=parts.place,
        moves=draw.commanded(moves, 0.2),
        damping=parts.damping,
        disturbances=disturbances,
        facts={"above_end_m": above_m, "load_kg": load_kg},
    )


def _disturbances(draw: Draw, above_m: float) -> Disturbances:
    x, y = draw.rng.normal(0, BESIDE_M, 2)
    beside = (float(x), float(y))
    if draw.variant % 4 == 0:
        slip_s = draw.uniform(0.35, 0.6) * draw.duration_s
        slip_m = min(draw.uniform(0.15, 0.4), 0.6 * above_m)
        return Disturbances(beside, slip=(slip_s, slip_m, TURN_DEG * draw.sign()), drift_g=0.002)
    if draw.variant % 4 == 1:
        count = max(3, round(draw.uniform(4, 10) * draw.duration_s / 120))
        impacts = tuple(
            (draw.uniform(5, draw.duration_s - 2), draw.uniform(0.02, 0.06), draw.uniform(0.2, 1.0))
            for _ in range(count)
        )
        return Disturbances(beside, askew_deg=7.0, step_g=0.004, impacts=impacts)
    if draw.variant % 4 == 2:
        return Disturbances(beside, vibration=(draw.uniform(12, 25), draw.uniform(0.05, 0.15)))
    return Disturbances(beside, radio=(0.05, draw.uniform(0.004, 0.02)))
