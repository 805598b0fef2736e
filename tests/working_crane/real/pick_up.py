"""Kind h: what hangs changes: pick-up, set-down, drag, snag, an empty hook with chains, two cranes with one beam."""

import mujoco
import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.bodies import hook_damping, hung, inertia, pivot, point, point_damping, site
from tests.working_crane.real.draw import LEAD_IN_S, Draw
from tests.working_crane.real.engine import PRESCRIBED_KG
from tests.working_crane.real.heavy_rope import chain
from tests.working_crane.real.moves import Move
from tests.working_crane.real.reeving import CORNERS
from tests.working_crane.real.rig import G_M_S2, Outside, OutsideFactory, Place, Rig, Rope

HOOK_DRAG_1_S = 0.3
"""Of a hook that slings jerk."""
SNAG_N_M_KG = 40.0
"""Stiffness of what a load catches, per mass of the load."""


def pick_up(draw: Draw) -> Rig:
    """Draw in turn: pick-up and set-down, drag and snag, an empty hook with chains, two cranes with one beam."""
    return (lifted, lifted, empty_hook, tandem)[draw.variant % 4](draw)


def lifted(draw: Draw) -> Rig:
    """A load on the ground, beside the hook, in slack slings: picked up, carried, set down. It may drag and snag."""
    drags = draw.variant % 4 == 1
    hook_m, load_kg, hook_kg = draw.uniform(9, 16), draw.log_uniform(900, 4000), draw.uniform(200, 400)
    half = np.array([draw.uniform(0.5, 1.2), draw.uniform(0.4, 0.8), draw.uniform(0.3, 0.7)])
    sling_m, slack_m = draw.uniform(1.5, 3.0), draw.uniform(0.15, 0.5)
    away_m = draw.uniform(0.9, 1.6) if drags else draw.uniform(0.1, 0.5)
    friction = draw.uniform(0.2, 0.35) if drags else draw.uniform(0.4, 0.8)
    above_hook_m = draw.uniform(0.5, 0.3 * hook_m)
    middle_m = float(np.sqrt(sling_m**2 - half[0] ** 2 - half[1] ** 2) if sling_m > np.hypot(*half[:2]) else 0.5)
    sling_m = float(np.sqrt(middle_m**2 + half[0] ** 2 + half[1] ** 2))
    ground_m = hook_m + middle_m - slack_m + 2 * half[2]
    moves = _carry(draw, hook_m, slack_m, draw.uniform(1.2, 2.2))
    snag = _snag(draw, moves) if drags else None
    rope = hung("rope", ("pivot", "hook"), hook_m, load_kg + hook_kg, draw.uniform(2.0, 4.0), 1)
    one = hung("sling", (), sling_m, load_kg / 4, draw.uniform(4, 7))
    slings = [Rope(f"sling{i}", ("hook", f"eye{i}"), sling_m, one.axial_n, one.damping_n_s_m) for i in range(4)]
    return Rig(
        bodies=pivot(site("pivot"))
        + point("hook", hook_kg, 0.0, -hook_m)
        + _box(load_kg, half, away_m, ground_m, friction),
        ropes=(rope, *slings),
        place=Place("pivot", "hook", above_end_m=above_hook_m),
        moves=draw.commanded(moves, 0.2),
        end="hook",
        damping={"load": (0.002 * load_kg,) * 3 + (0.05 * load_kg,) * 3, **hook_damping(hook_kg, HOOK_DRAG_1_S)},
        outside=None if snag is None else snagged("load", snag),
        touch=True,
        load_length=True,
        facts={
            "above_end_m": above_hook_m,
            "below_end_m": middle_m + float(half[2]),
            "load_kg": load_kg,
            "hook_kg": hook_kg,
            "slings": middle_m + float(half[2]),
            "load_at_rest": True,
            "snag": None if snag is None else {"from_s": snag[0], "to_s": snag[1], "limit_of_weight": snag[2]},
            "away_m": away_m,
            "friction": friction,
        },
    )


def _carry(draw: Draw, length_m: float, slack_m: float, up_m: float) -> list[Move]:
    """Return a slow hoist until the load is off the ground, a faster one, transport, and the same way down again."""
    slow, fast, ramp_s = draw.uniform(0.06, 0.12), draw.uniform(0.15, 0.28), 0.8
    tight_m = slack_m + 0.2
    tighten = Move("hoist", draw.uniform(7, 12), -slow, ramp_s, tight_m / slow - ramp_s)
    lift = Move("hoist", tighten.end_s + draw.uniform(0, 2), -fast, ramp_s, up_m / fast - ramp_s, 0.15)
    lower_s = draw.duration_s - draw.uniform(5, 9) - tight_m / slow - ramp_s - up_m / fast - ramp_s - 1.0
    lower = Move("hoist", lower_s, fast, ramp_s, up_m / fast - ramp_s, 0.15)
    set_down = Move("hoist", lower.end_s + 1.0, slow, ramp_s, tight_m / slow - ramp_s)
    axes, span_s = {"x": 0.5, "y": 0.5}, (lift.end_s + 2, lower_s - 2)
    between = draw.work(length_m, axes, span_s=span_s, accel_m_s2=(0.06, 0.24), fastest_m_s=0.9)
    return [tighten, lift, *between, lower, set_down]


def _snag(draw: Draw, moves: list[Move]) -> tuple[float, float, float]:
    """Return start, end and greatest force per weight of a snag during one of the drives."""
    drives = [move for move in moves if move.axis != "hoist"]
    if not drives:
        return 0.5 * draw.duration_s, 0.5 * draw.duration_s + 5.0, 0.05
    drive = drives[int(draw.rng.integers(len(drives)))]
    return drive.start_s + 0.5, drive.start_s + 0.5 + draw.uniform(3, 7), draw.uniform(0.02, 0.1)


def _box(mass_kg: float, half_m: Array, away_m: float, ground_m: float, friction: float) -> str:
    """A box on the ground, turned a little, with an eye at each upper corner."""
    x, y, z = np.square(2 * half_m) * mass_kg / 12
    eyes = "".join(site(f"eye{i}", sx * half_m[0], sy * half_m[1], half_m[2]) for i, (sx, sy) in enumerate(CORNERS))
    shape = f'type="box" size="{half_m[0]} {half_m[1]} {half_m[2]}" friction="{friction} 0.005 0.0001"'
    ground = f'<geom type="plane" size="0 0 1" pos="0 0 {-ground_m}" friction="{friction} 0.005 0.0001"/>'
    return (
        f'{ground}<body name="load" pos="{away_m} 0 {-ground_m + half_m[2]}"><freejoint name="load"/>'
        f'{inertia(mass_kg, "0 0 0", f"{y + z} {x + z} {x + y}")}<geom {shape} mass="0"/>{site("load")}{eyes}</body>'
    )


class _Snag:
    """A spring to the place where the load was caught, horizontal, up to the force at which it breaks."""

    def __init__(
        self, model: mujoco.MjModel, body: str, window_s: tuple[float, float], limit: float, time_s: Array
    ) -> None:
        self._number = model.body(body).id
        self._limit_n = limit * float(model.body_mass[self._number]) * G_M_S2
        self._stiffness_n_m = SNAG_N_M_KG * float(model.body_mass[self._number])
        self._window_s, self._time_s = window_s, time_s
        self._caught: Array | None = None
        self._broken = False
        self.pulls = False

    def __call__(self, data: mujoco.MjData, stage: int) -> None:
        start_s, end_s = self._window_s
        self.pulls = start_s <= self._time_s[stage] < end_s and not self._broken
        data.xfrc_applied[self._number, :2] = 0.0
        if not self.pulls:
            return
        place = data.xpos[self._number, :2]
        if self._caught is None:
            self._caught = place.copy()
        force: Array = self._stiffness_n_m * (self._caught - place)
        self._broken = float(np.hypot(*force)) > self._limit_n
        if not self._broken:
            data.xfrc_applied[self._number, :2] = force


def snagged(body: str, snag: tuple[float, float, float]) -> OutsideFactory:
    """Return what holds this body from the first to the second time, or until the force per weight exceeds the third."""

    def make(model: mujoco.MjModel, time_s: Array) -> Outside:
        return _Snag(model, body, snag[:2], snag[2], time_s)

    return make


def empty_hook(draw: Draw) -> Rig:
    """A hook block with chains that hang from it, and no load."""
    length_m, hook_kg = draw.uniform(8, 20), draw.uniform(200, 500)
    chain_m, chain_kg, ratio = draw.uniform(1.5, 3.0), draw.uniform(25, 90), draw.uniform(0.001, 0.005)
    above_m = draw.uniform(0.5, 0.35 * length_m)
    rope = hung("rope", ("pivot", "hook"), length_m, hook_kg + chain_kg, draw.uniform(2.5, 5.0), 1)
    links = 4
    slides = point("hook", hook_kg, 0.0, -length_m).removesuffix("</body>")
    moves = draw.work(length_m, {"x": 0.4, "y": 0.4, "hoist": 0.2}, bounds_m=(0.75 * length_m, 1.25 * length_m))
    return Rig(
        bodies=pivot(site("pivot")) + slides + chain(chain_m, chain_kg, 0.0, links) + "</body>",
        ropes=(rope,),
        place=Place("pivot", "hook", above_end_m=above_m),
        moves=draw.commanded(moves, 0.2),
        end="hook",
        load="hook",
        damping={
            **point_damping("hook", hook_kg, length_m, ratio),
            **{f"link{i}{axis}": 0.02 * chain_kg for i in range(links) for axis in "xy"},
        },
        facts={"above_end_m": above_m, "load_kg": 0.0, "hook_kg": hook_kg, "chains": (chain_m, chain_kg)},
    )


def tandem(draw: Draw) -> Rig:
    """Two cranes that carry one beam at its ends; the second starts late and is a little faster or slower."""
    length_m, span_m, load_kg = draw.uniform(8, 20), draw.uniform(4, 10), draw.log_uniform(1500, 12000)
    above_m, late_s = draw.uniform(0.1, 0.6) * length_m, draw.uniform(0.05, 0.5)
    faster = 1 + draw.uniform(-0.03, 0.03)
    axes = {"x": 0.3, "y": 0.5, "hoist": 0.2}
    moves = draw.work(length_m, axes, bounds_m=(max(0.75 * length_m, above_m + 1), 1.25 * length_m))
    second = [
        Move(m.axis + "2", max(m.start_s + late_s, -LEAD_IN_S + 0.5), m.speed * faster, m.ramp_s, m.hold_s, m.brake)
        for m in moves
        if m.axis != "hoist"
    ]
    rope = hung("rope", ("pivot", "load"), length_m, load_kg / 2, draw.uniform(2.0, 4.5), 1)
    other = Rope("rope2", ("pivot2", "end2"), rope.rest_m, rope.axial_n, rope.damping_n_s_m, faster)
    slides = "".join(
        f'<joint name="{a}2" type="slide" axis="{axis}" armature="{PRESCRIBED_KG}"/>'
        for a, axis in (("x", "1 0 0"), ("y", "0 1 0"))
    )
    turning = f"{0.02 * load_kg} {load_kg * span_m**2 / 12} {load_kg * span_m**2 / 12}"
    drag = 2 * draw.uniform(0.001, 0.005) * load_kg * float(np.sqrt(G_M_S2 / length_m))
    return Rig(
        bodies=pivot(site("pivot"))
        + f'<body name="carrier2" pos="{span_m} 0 0">{slides}{inertia(1.0)}{site("pivot2")}</body>'
        + f'<body name="beam" pos="{span_m / 2} 0 {-length_m}"><freejoint name="beam"/>'
        + inertia(load_kg, "0 0 -0.3", turning)
        + f"{site('load', -span_m / 2)}{site('end2', span_m / 2)}{site('middle')}</body>",
        ropes=(rope, other),
        place=Place("pivot", "load", above_end_m=above_m),
        moves=draw.commanded([*moves, *second], 0.2),
        driven=("x", "y", "x2", "y2"),
        damping={"beam": (drag,) * 3 + (0.01 * load_kg, drag, drag)},
        facts={"above_end_m": above_m, "load_kg": load_kg, "beam_m": span_m, "faster": faster, "late_s": late_s},
    )
