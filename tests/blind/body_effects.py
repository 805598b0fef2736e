"""Effects of the catalogue by which load, rope and pivot are bodies: inertia, mass, friction, a structure that yields."""

from dataclasses import asdict

import numpy as np

from tests.blind.mechanics import Holding, Structure
from tests.blind.scene import Draw, Effect, Rig, Scene, horizontal

Generator = np.random.Generator
RELEASED_BOW = 2 / np.pi**3
"""Bow of a rope whose load is held aside beyond that in the swing, over mass ratio, length and angle: it sags twice as far."""


def load_inertia(rng: Generator, rig: Rig, size: float) -> Effect:
    """A long load that turns with the rope."""
    gyration_m = float(np.sqrt(size * rng.uniform(0.006, 0.05))) * rig.length_m

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(gyration_m=gyration_m)

    return Effect("load_inertia", {"radius_of_gyration_m": gyration_m}, apply)


def pivot_compliance(rng: Generator, rig: Rig, size: float) -> Effect:
    """A jib or a girder that is soft sideways, with a mode of its own above the swing."""
    soft_m = size * float(rng.uniform(0.006, 0.03)) * rig.length_m
    structure = Structure(
        frequency_hz=float(rng.uniform(0.8, 3.0)),
        damping_ratio=float(rng.uniform(0.02, 0.06)),
        deflection_m=(soft_m, soft_m * float(rng.uniform(0.02, 0.4))),
        azimuth_rad=float(rng.uniform(0, np.pi)),
    )

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(structure=structure)

    return Effect("pivot_compliance", asdict(structure), apply)


def rope_mass(rng: Generator, rig: Rig, size: float) -> Effect:
    """A heavy rope, as a chain; half of them are released by hand and ring as a string."""
    rope_kg, rings = size * float(rng.uniform(0.04, 0.2)), bool(rng.random() < 0.5)
    released_m = RELEASED_BOW * rope_kg * rig.length_m * rig.amplitude_rad

    def apply(scene: Scene, run: Generator) -> Scene:
        bow_m = horizontal(run, released_m * run.uniform(0.5, 1.0)) if rings else (0.0, 0.0)
        return scene.with_mechanics(rope_kg=rope_kg, share=0.0).with_start(bow_m=bow_m)

    return Effect("rope_mass", {"relative_density_1_m": rope_kg / rig.length_m}, apply)


def pivot_friction(rng: Generator, rig: Rig, size: float) -> Effect:
    """A bearing that holds by some tenths of a degree to some degrees before it slides."""
    hold_rad, presliding_rad = (
        size * float(rng.uniform(5e-4, 1.5e-3)),
        float(np.exp(rng.uniform(*np.log([0.006, 0.04])))),
    )
    holding = Holding(hold_rad, presliding_rad)

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(holding=holding)

    return Effect("pivot_friction", {"hold_rad": hold_rad, "presliding_rad": presliding_rad}, apply)


BODIES: dict[str, Draw] = {draw.__name__: draw for draw in (load_inertia, pivot_compliance, rope_mass, pivot_friction)}
