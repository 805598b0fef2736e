"""Kind f: turbulent wind all the time, beside ordinary work."""

from tests.working_crane.real.draw import Draw
from tests.working_crane.real.one_rope import one_rope
from tests.working_crane.real.rig import G_M_S2, Rig
from tests.working_crane.real.turbulence import AIR_KG_M3, blown, wind_m_s


def windy(draw: Draw) -> Rig:
    """Draw wind of 2 to 10 m/s whose mean leans the load by 0.2 to 3 deg; in one case of three the load hangs in slings."""
    length_m, load_kg = draw.uniform(8, 28), draw.log_uniform(700, 5000)
    above_m = draw.uniform(0.12, 0.75) * length_m
    mean_m_s, lean = draw.uniform(2, 10), draw.log_uniform(0.004, 0.045)
    area_m2 = min(lean * load_kg * G_M_S2 / (0.5 * AIR_KG_M3 * mean_m_s**2), 3.0 * (load_kg / 200) ** (2 / 3))
    slings = (draw.uniform(1.5, 3.0), draw.uniform(0.06, 0.14)) if draw.variant % 3 == 2 else None
    parts = one_rope(
        draw, length_m, load_kg, above_m, bounce_hz=draw.uniform(2.0, 4.5), slings=slings, air=slings is not None
    )
    wind = wind_m_s(draw.rng, draw.time_s, mean_m_s)
    axes = {"x": 0.42, "y": 0.42, "hoist": 0.22}
    moves = draw.work(length_m, axes, bounds_m=(max(0.75 * length_m, above_m + 1), 1.25 * length_m))
    return Rig(
        bodies=parts.bodies,
        ropes=parts.ropes,
        place=parts.place,
        moves=draw.commanded(moves, 0.2),
        end=parts.end,
        damping=parts.damping,
        outside=blown("load", wind.velocity_m_s, area_m2),
        gust=wind.gust,
        facts={
            "above_end_m": above_m,
            "wind_m_s": mean_m_s,
            "cda_m2": area_m2,
            "load_kg": load_kg,
            "slings": slings,
        },
    )
