"""The housing's place and axes at every step, and the specific force there: second difference of the place, and gravity."""

from dataclasses import dataclass

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.engine import Trace
from tests.working_crane.real.rig import G_M_S2, Disturbances, Place

SLIP_S = 0.6
"""A clamp takes this time to slip."""


@dataclass(frozen=True, slots=True)
class HousingMotion:
    """One row per step."""

    force_g: Array
    """Specific force in the axes of the rope or body, shape (n, 3); two rows at each end are not valid."""
    rest_g: Array
    """The same while the load hangs at rest, shape (3,): a load that a recording begins with may stand beside the hook."""
    up: Array
    """Unit vector up the part of rope at the housing, world axes, shape (n, 3)."""


def housing_motion(trace: Trace, place: Place, given: Disturbances, heading_rad: Array, time_s: Array) -> HousingMotion:
    """Return the specific force that the housing feels."""
    line = trace.sites[place.top] - trace.sites[place.bottom]
    up = line / np.linalg.norm(line, axis=1)[:, None]
    gravity = np.array([0.0, 0.0, 1.0])
    rest_up = gravity
    if place.leans_by_design:
        rest_line = trace.rest[place.top] - trace.rest[place.bottom]
        rest_up = rest_line / np.linalg.norm(rest_line)
    if place.body_site is not None:
        assert trace.pose is not None
        assert trace.rest_pose is not None
        force = specific_force_g(trace.sites[place.body_site], trace.pose, trace.step_s)
        return HousingMotion(force, gravity @ trace.rest_pose, up)
    slipped = _slipped(given, time_s)
    turn = np.zeros(len(time_s)) if given.slip is None else np.radians(given.slip[2]) * slipped
    down_m = np.zeros(len(time_s)) if given.slip is None else given.slip[1] * slipped
    if place.below_top_m is None:
        assert place.above_end_m is not None
        spot = trace.sites[place.bottom] + up * (place.above_end_m - down_m)[:, None]
    else:
        spot = trace.sites[place.top] - up * (place.below_top_m + down_m)[:, None]
    axes = untwisted_axes(up, heading_rad + turn)
    spot = spot + axes[:, :, 0] * given.beside_m[0] + axes[:, :, 1] * given.beside_m[1]
    return HousingMotion(specific_force_g(spot, axes, trace.step_s), gravity @ leaning_axes(rest_up[None])[0], up)


def specific_force_g(place_m: Array, axes: Array, step_s: float) -> Array:
    """Return second difference (fourth order) plus gravity, in the given axes."""
    acceleration = np.zeros_like(place_m)
    outer, inner = place_m[:-4] + place_m[4:], place_m[1:-3] + place_m[3:-1]
    acceleration[2:-2] = (16 * inner - outer - 30 * place_m[2:-2]) / (12 * step_s**2)
    acceleration[:, 2] += G_M_S2
    turned: Array = np.einsum("nij,ni->nj", axes, acceleration) / G_M_S2
    return turned


def leaning_axes(up: Array) -> Array:
    """Return the world's axes turned by the shortest way so that z is `up`; axes are columns, shape (n, 3, 3)."""
    a, b, c = up.T
    share = a * b / (1 + c)
    x = np.column_stack([1 - a**2 / (1 + c), -share, -a])
    y = np.column_stack([-share, 1 - b**2 / (1 + c), -b])
    return np.stack([x, y, up], axis=2)


def untwisted_axes(up: Array, heading_rad: Array) -> Array:
    """Return axes along `up` whose angular velocity about it is that of the heading alone."""
    leaning = leaning_axes(up)
    x, y = leaning[:, :, 0], leaning[:, :, 1]
    steps = np.sum(np.diff(x, axis=0) * (y[1:] + y[:-1]) / 2, axis=1)
    turn = heading_rad - np.concatenate([[0.0], np.cumsum(steps)])
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, up], axis=2)


def _slipped(given: Disturbances, time_s: Array) -> Array:
    """Return the share of the slip that is done: a smooth step."""
    if given.slip is None:
        return np.zeros(len(time_s))
    part = np.clip((time_s - given.slip[0]) / SLIP_S, 0.0, 1.0)
    done: Array = part**3 * (10 + part * (6 * part - 15))
    return done
