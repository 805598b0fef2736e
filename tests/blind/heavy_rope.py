"""A rope with mass as a chain of rigid links of MuJoCo, and the shape in which it swings with its load."""

import numpy as np

LINKS = 6
BENDING_1_S = 100.0
"""Damping of a joint over the inertia of a link: the first mode as a string dies away in about 3 s."""


def slopes(mass_ratio: float) -> list[float]:
    """Slope of each link over that of the straight line to the load, in the swing: y' = 1 + mu (x - x^2/2 - 1/3).

    First order in mu of [(1 + mu (1 - x)) y']' = -mu x, y(0) = 0, y(1) = 1, with x from the pivot.
    """
    middles = (np.arange(LINKS) + 0.5) / LINKS
    return [float(1 + mass_ratio * (x - x**2 / 2 - 1 / 3)) for x in middles]


def chain_xml(length_m: float, position_m: float, rope_kg: float, end: str) -> str:
    """Links from the pivot down, the accelerometer on the one at its place, `end` below the last; the load has 1 kg."""
    link_m, link_kg = length_m / LINKS, rope_kg / LINKS
    across = link_kg * link_m**2 / 12
    held = min(int(position_m / link_m), LINKS - 1)
    xml = f'<body name="end" pos="0 0 {-link_m}"><site name="with_load"/>{end}</body>'
    for i in reversed(range(LINKS)):
        site = f'<site name="on_rope" pos="0 0 {held * link_m - position_m}"/>' if i == held else ""
        joint = 'name="swing"' if i == 0 else f'name="link{i}" damping="{BENDING_1_S * across}"'
        inertia = f'<inertial pos="0 0 {-link_m / 2}" mass="{link_kg}" diaginertia="{across} {across} {across}"/>'
        place = "0 0 0" if i == 0 else f"0 0 {-link_m}"
        xml = f'<body name="rope{i}" pos="{place}"><joint type="ball" {joint}/>{inertia}{site}{xml}</body>'
    return xml
