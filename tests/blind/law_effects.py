"""Effects outside the catalogue that only tests of the equations hide: no campaign draws from them."""

import math

import numpy as np

from tests.blind.mechanics import Vector
from tests.blind.scene import Draw, Effect, Rig, Scene, adding, signed


def guide_with_play(rng: np.random.Generator, rig: Rig, size: float) -> Effect:
    """A guide holds the load back where it has crossed the play."""
    reach_m = rig.length_m * rig.amplitude_rad
    play_m = float(rng.uniform(0.2, 0.5)) * reach_m
    stiffness_1_s2 = size * float(rng.uniform(0.02, 0.08))

    def hold(x: float, y: float, _z: float) -> Vector:
        factor = -stiffness_1_s2 * max(0.0, 1 - play_m / max(math.hypot(x, y), 1e-9))
        return factor * x, factor * y, 0.0

    return Effect("guide_with_play", {"play_m": play_m, "stiffness_1_s2": stiffness_1_s2}, adding(place_force=hold))


def late_axes(rng: np.random.Generator, rig: Rig, size: float) -> Effect:
    """The axes across the rope are sampled later, or earlier, than the axial one."""
    delay_s = size * signed(rng, 0.03, 0.12)

    def delay(time_s: np.ndarray, reading_g: np.ndarray) -> np.ndarray:
        across = [np.interp(time_s - delay_s, time_s, reading_g[:, axis]) for axis in (0, 1)]
        return np.column_stack([*across, reading_g[:, 2]])

    def apply(scene: Scene, _run: np.random.Generator) -> Scene:
        return scene.with_sensor(distortions=(*scene.sensor.distortions, delay))

    return Effect("late_axes", {"delay_s": delay_s}, apply)


LAW_EFFECTS: dict[str, Draw] = {draw.__name__: draw for draw in (guide_with_play, late_axes)}
