"""One elastic rope with a point load, or with a hook and the load in slings: what several kinds have in common."""

from dataclasses import dataclass

from tests.working_crane.real.bodies import hook_damping, hung, pivot, point, point_damping, site
from tests.working_crane.real.draw import Draw
from tests.working_crane.real.rig import Place, Rope


@dataclass(frozen=True, slots=True)
class OneRope:
    """Parts of a `Rig`."""

    bodies: str
    ropes: tuple[Rope, ...]
    place: Place
    end: str
    damping: dict[str, float | tuple[float, ...]]


def one_rope(
    draw: Draw,
    length_m: float,
    load_kg: float,
    above_end_m: float,
    *,
    bounce_hz: float,
    slings: tuple[float, float] | None = None,
    axes: str = "xy",
    carrier: str | None = None,
    air: bool = True,
) -> OneRope:
    """Return a crane of one rope; `slings` are their length in m and the hook's share of the load's mass.

    `carrier` replaces the driven pivot; without `air` the load has no drag of its own.
    """
    ratio = draw.uniform(0.001, 0.006) if air else 0.0
    top = carrier if carrier is not None else pivot(site("pivot"), axes)
    damping = point_damping("load", load_kg, length_m, ratio)
    if slings is None:
        rope = hung("rope", ("pivot", "load"), length_m, load_kg, bounce_hz, 1)
        place = Place("pivot", "load", above_end_m=above_end_m)
        return OneRope(top + point("load", load_kg, 0.0, -length_m), (rope,), place, "load", damping)
    sling_m, share = slings
    bodies = point("hook", share * load_kg, 0.0, -length_m) + point("load", load_kg, 0.0, -length_m - sling_m)
    ropes = (
        hung("rope", ("pivot", "hook"), length_m, (1 + share) * load_kg, bounce_hz, 1),
        hung("sling", ("hook", "load"), sling_m, load_kg, draw.uniform(5, 8)),
    )
    damping |= hook_damping(share * load_kg, draw.uniform(0.04, 0.12))
    return OneRope(top + bodies, ropes, Place("pivot", "hook", above_end_m=above_end_m), "hook", damping)
