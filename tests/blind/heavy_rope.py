"""A rope with mass as a chain of rigid links of MuJoCo, and the shape in which it swings with its load."""

from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from tests.blind.mechanics import Array

LINKS = 10
RINGING_1_S = 0.15
"""Damping of the motion beside the straight line to the load, over the mass: the rope rings as a string for some 13 s, its
higher modes less long."""
INERTIA = 1 / 6
"""Of a link across it, over its mass and length squared: between a rod and two points, so that the string mode of the chain is
that of a rope to the fourth power of a link's length."""


def nodes(length_m: float, position_m: float) -> Array:
    """Distances of the joints from the pivot, and of the end, in m: the accelerometer is in the middle of a link."""
    half_m = length_m / LINKS / 2
    above = min(max(round((position_m - half_m) / (2 * half_m)), 1), LINKS - 2)
    upper = np.linspace(0, position_m - half_m, above + 1)
    lower = np.linspace(position_m + half_m, length_m, LINKS - above)
    return np.concatenate([upper, lower])


def slopes(length_m: float, position_m: float, mass_ratio: float) -> tuple[Array, Array]:
    """Slope of each link over that of the straight line to the load in the swing, and by a bow sin(pi x) in m as a string.

    In the swing, y' = 1 + mu (x - x^2/2 - 1/3).

    First order in mu of [(1 + mu (1 - x)) y']' = -mu x, y(0) = 0, y(1) = 1, with x from the pivot.
    """
    ends = nodes(length_m, position_m) / length_m
    middles = (ends[1:] + ends[:-1]) / 2
    in_swing = 1 + mass_ratio * (middles - middles**2 / 2 - 1 / 3)
    by_bow: Array = np.diff(np.sin(np.pi * ends)) / np.diff(ends) / length_m
    return in_swing, by_bow


def chain_xml(length_m: float, position_m: float, rope_kg: float, end: str) -> str:
    """Links from the pivot down, the accelerometer on the one at its place, `end` below the last; the load has 1 kg.

    A link is free to turn about itself, as a rope on a swivel.
    """
    links = list(pairwise(nodes(length_m, position_m).tolist()))
    excess_m = (
        (INERTIA - 1 / 12) * rope_kg * (length_m / LINKS) ** 2 / length_m
    )  # of the inertia, which the load gives back
    xml = f'<body name="end" pos="0 0 {links[-1][0] - links[-1][1] + excess_m}"><site name="with_load"/>{end}</body>'
    for i, (begin_m, end_m) in reversed(list(enumerate(links))):
        link_m, link_kg = end_m - begin_m, rope_kg * (end_m - begin_m) / length_m
        across = INERTIA * link_kg * link_m**2
        site = f'<site name="on_rope" pos="0 0 {begin_m - position_m}"/>' if begin_m < position_m < end_m else ""
        joint = '<joint name="swing" type="ball"/>' if i == 0 else '<joint type="ball"/>'
        inertia = f'<inertial pos="0 0 {-link_m / 2}" mass="{link_kg}" diaginertia="{across} {across} {across}"/>'
        place = "0 0 0" if i == 0 else f"0 0 {links[i - 1][0] - begin_m}"
        xml = f'<body name="rope{i}" pos="{place}">{joint}{inertia}{site}{xml}</body>'
    return xml


class RopeDamping:
    """Forces against the motion of the links beside the straight line from the pivot to the load."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data, self._load = model, data, model.body("load").id
        self._links = np.array([model.body(f"rope{i}").id for i in range(LINKS)])
        self._mass_kg = model.body_mass[self._links]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        place_m = np.linalg.norm(data.xipos[self._links], axis=1)
        self._share = (place_m / np.linalg.norm(data.xpos[self._load]))[:, None]

    def apply(self) -> Array:
        """Set the forces on the links, N; return that on the load which leaves the torque about the pivot as it is."""
        of_load = self._velocity(np.array([self._load]), self._data.xpos)
        of_links = self._velocity(self._links, self._data.xipos)
        beside = np.pad(of_links - self._share * of_load, ((1, 1), (0, 0)))
        bending = -((LINKS / np.pi) ** 2) * np.diff(beside, 2, axis=0)  # the motion itself where that is sin(pi x)
        force = -RINGING_1_S * self._mass_kg[:, None] * bending
        self._data.xfrc_applied[self._links, :3] = force
        on_load: Array = -(self._share * force).sum(axis=0)
        return on_load

    def _velocity(self, bodies: NDArray[np.int64], place_m: Array) -> Array:
        """Velocity of points of bodies in the world, m/s; the engine refers it to the centre of what hangs there."""
        centre_m = self._data.subtree_com[self._model.body_rootid[bodies]]
        spin, speed = self._data.cvel[bodies, :3], self._data.cvel[bodies, 3:]
        found: Array = speed + np.cross(spin, place_m[bodies] - centre_m)
        return found
