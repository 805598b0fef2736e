"""One case simulated and sampled: what the sensor reads, the truth, and what a rigger states."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.draw import LEAD_IN_S, Draw
from tests.working_crane.real.engine import Trace, simulate
from tests.working_crane.real.housing import housing_motion
from tests.working_crane.real.kinds import KINDS
from tests.working_crane.real.rig import Disturbances, Rig
from tests.working_crane.real.sensor import draw_errors, radio, readings_g
from tests.working_crane.real.truth import heading_rad, truth_at

LONGEST_STEP_S = 0.00251
TAIL_STEPS = 4
RATES_HZ = (50.0, 62.5, 100.0, 125.0)
ANGLES_DEG = (2.5, 13.0)
"""A case whose largest angle is outside is drawn again, first with other speeds."""
MEAN_G = (0.9, 1.1)
"""Mean of what the housing feels: outside, a rope has whipped itself up by rounding, and the case is none."""
ATTEMPTS = 6
AIM_DEG = (4.0, 10.0)
LENGTH_U, PLACE_U, PLACE_U_M = 0.04, 0.02, 0.01
"""One sigma of what a rigger states."""


@dataclass(frozen=True, slots=True)
class Recording:
    """Everything that is written."""

    kind: str
    log_time_s: Array
    reading_g: Array
    truth: dict[str, Array]
    stated: dict[str, float]
    """`length_m`, and `above_load_m` or `position_m`, and perhaps `mount_u_deg`."""
    facts: dict[str, Any]


def make(kind: str, seed: int, index: int, duration_s: float = 180.0, rate_hz: float | None = None) -> Recording:
    """Return the recording of this number; its variant follows from the number."""
    case_seed = int(np.random.default_rng([seed, ord(kind), index]).integers(2**32))
    chooser = np.random.default_rng([case_seed, 1])
    chosen_hz = float(chooser.choice(RATES_HZ))
    rate_hz = chosen_hz if rate_hz is None else rate_hz
    aim_deg, vigour = chooser.uniform(*AIM_DEG), 1.0
    steps_per_sample = int(np.ceil(1 / (rate_hz * LONGEST_STEP_S)))
    step_s = 1 / (rate_hz * steps_per_sample)
    lead_steps = round(LEAD_IN_S * rate_hz) * steps_per_sample
    steps = lead_steps + round(duration_s * rate_hz) * steps_per_sample + TAIL_STEPS
    time_s = (np.arange(2 * steps + 2) - 2 * lead_steps) * step_s / 2
    for attempt in range(ATTEMPTS):
        draw = Draw(np.random.default_rng([case_seed, 2, attempt // 2]), index, time_s, duration_s, vigour)
        rig = KINDS[kind][1](draw)
        trace = simulate(rig, step_s, steps)
        rows = slice(lead_steps, steps - TAIL_STEPS, steps_per_sample)
        truth = truth_at(rig, trace, rows)
        largest_deg = float(truth["angle_deg"].max())
        if ANGLES_DEG[0] <= largest_deg <= ANGLES_DEG[1]:
            break
        vigour = 1.0 if attempt % 2 else float(np.clip(aim_deg / largest_deg, 0.15, 2.2))
    rng = np.random.default_rng([case_seed, 3])
    heading = heading_rad(rig, trace)
    motion = housing_motion(trace, rig.place, rig.disturbances, heading, time_s[::2][:steps])
    mean_g = float(np.linalg.norm(motion.force_g[rows], axis=1).mean())
    if not MEAN_G[0] < mean_g < MEAN_G[1]:
        raise RuntimeError(
            f"the engine lost the motion of kind {kind}, seed {seed}, number {index}: {mean_g:.2f} g on average"
        )
    truth["slope_deg"] = np.degrees(np.arctan2(np.hypot(motion.up[rows, 0], motion.up[rows, 1]), motion.up[rows, 2]))
    errors = draw_errors(rng)
    given = rig.disturbances
    reading = readings_g(motion.force_g[rows], motion.rest_g, truth["time_s"], errors, given, rng)
    arrived, stamps_s = radio(truth["time_s"], given, rng)
    length_m, stated = _stated(rig, trace, rng)
    facts = {
        "kind": kind,
        "what": KINDS[kind][0],
        "variant": index,
        "seed": case_seed,
        "length_m": length_m,
        "rho": 1 - _above_m(rig, trace) / length_m,
        "noise_g": errors.noise_g,
        "fs_hz": int(rate_hz) if rate_hz == int(rate_hz) else rate_hz,
        "hook": None,
        "largest_deg": largest_deg,
        "effects": {k: v for k, v in asdict(given).items() if v != getattr(Disturbances(), k)},
        **rig.facts,
        "events": [move.as_json() for move in rig.moves.moves if not move.axis.endswith("2")],
    }
    return Recording(kind, stamps_s, reading[arrived], truth, stated, facts)


def _length_m(rig: Rig, trace: Trace) -> float:
    """Return the distance from the pivot to the rope's end at rest, or to the load where that is stated."""
    pivot = np.mean([trace.rest[name] for name in rig.pivots], axis=0)
    below = float(rig.facts["below_end_m"]) if rig.load_length else 0.0
    return float(np.linalg.norm(trace.rest[rig.end] - pivot)) + below


def _above_m(rig: Rig, trace: Trace) -> float:
    """Return the housing's distance to what `_length_m` ends at."""
    if rig.place.below_top_m is not None:
        return _length_m(rig, trace) - rig.place.below_top_m
    below = float(rig.facts["below_end_m"]) if rig.load_length else 0.0
    return float(rig.facts["above_end_m"]) + below


def _stated(rig: Rig, trace: Trace, rng: np.random.Generator) -> tuple[float, dict[str, float]]:
    """Return the true length, and what a careful rigger writes."""
    length_m = _length_m(rig, trace)
    believed_m = length_m * (1 + LENGTH_U * float(rng.normal()))
    share, extra_m = 1 + PLACE_U * float(rng.normal()), PLACE_U_M * float(rng.normal())
    stated = {"length_m": believed_m}
    if rig.place.below_top_m is not None:
        stated["position_m"] = min(rig.place.below_top_m * share + extra_m, believed_m)
    else:
        place_m = 0.3 if rig.place.body_site is not None else _above_m(rig, trace) * share + extra_m
        stated["above_load_m"] = float(np.clip(place_m, 0.05, believed_m - 0.2))
    if rig.disturbances.askew_deg:
        stated["mount_u_deg"] = 5.0
    return length_m, stated
