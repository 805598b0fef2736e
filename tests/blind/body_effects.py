"""Effects of the catalogue by which load, rope and pivot are bodies: inertia, mass, friction, a structure that yields."""

import numpy as np

from tests.blind.scene import Draw, Effect, Rig, Scene

Generator = np.random.Generator


def load_inertia(rng: Generator, rig: Rig, size: float) -> Effect:
    """A long load that turns with the rope."""
    gyration_m = float(np.sqrt(size * rng.uniform(0.006, 0.05))) * rig.length_m

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(gyration_m=gyration_m)

    return Effect("load_inertia", {"radius_of_gyration_m": gyration_m}, apply)


BODIES: dict[str, Draw] = {draw.__name__: draw for draw in (load_inertia,)}
