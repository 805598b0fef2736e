"""A case of a plan: the believed rig, what it measures with the effect in it, and the truth."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.blind.believed import BelievedMotion
from tests.blind.engine import simulate
from tests.blind.law_effects import LAW_EFFECTS
from tests.blind.mechanics import Mechanics, Motion, Start
from tests.blind.outside import ALSO_TRUE, OUTSIDE
from tests.blind.plan import CATALOGUE, Plan
from tests.blind.scene import Effect, Rig, Scene
from tests.blind.sensor import Recording, Sampling, Sensor, Temperature, record

LENGTHS_S = {"log": 120.0, "held_out": 72.0}
SETTLE_S = 4.0
"""A low-pass has been running for so long before the recording."""
MARGIN_S = 1.0
"""The engine goes on for so long after the last even sample: a clock that runs fast asks for more."""
USUAL, SMALL = 1.0, 0.35
VISIBLE = 0.03
"""Least excess of the reduced chi-square on the log that an effect makes by itself when the initial motion has been fitted."""
DRAWS, RIGS = 4, 40
"""Tries of an effect on one rig; rigs tried."""


@dataclass(frozen=True, slots=True)
class Case:
    """A believed rig, its recordings by name, and the truth about them."""

    rig: Rig
    recordings: dict[str, Recording]
    truth: dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Run:
    name: str
    duration_s: float
    start: Start
    seed: np.random.SeedSequence


def generate(plan: Plan, lengths_s: dict[str, float] | None = None) -> Case:
    """The same plan gives the same case. Where an effect does not show, another rig is drawn."""
    for rig_seed in np.random.SeedSequence(plan.seed).spawn(RIGS):
        case = _on_a_rig(plan, rig_seed, lengths_s or LENGTHS_S)
        if case is not None:
            return case
    raise ValueError(f"{' and '.join(plan.hidden)} shows on none of {RIGS} rigs; give the plan another seed")


def _on_a_rig(plan: Plan, seed: np.random.SeedSequence, lengths_s: dict[str, float]) -> Case | None:
    """None where an effect does not show."""
    rig_seed, effect_seed, *run_seeds = seed.spawn(2 + len(lengths_s))
    rng = np.random.default_rng(rig_seed)
    rig = _draw_rig(rng)
    world = _World(rig, _draw_sampling(rng, rig, plan), float(rng.uniform(12, 28)), float(rng.uniform(0.3, 0.8)))
    runs = []
    for (name, duration_s), run_seed in zip(lengths_s.items(), run_seeds, strict=True):
        runs.append(_Run(name, duration_s, draw_start(rng, rig), run_seed))
    believed = BelievedMotion(rig, runs[0].start, runs[0].duration_s * 1.02 + MARGIN_S)
    effects, alone = _draw_effects(np.random.default_rng(effect_seed), plan, world, runs[0], believed)
    if len(effects) < len(plan.hidden):
        return None
    measured = {run.name: world.measure(run, effects) for run in runs}
    truth = _truth(plan, world, effects) | {
        "excess": believed.excess(measured[runs[0].name][1]),
        "excess_alone": alone,
        "runs": {run.name: _facts(measured[run.name][0], run) for run in runs},
    }
    return Case(rig, {name: recording for name, (_, recording) in measured.items()}, truth)


@dataclass(frozen=True, slots=True)
class _World:
    """What stays from run to run."""

    rig: Rig
    sampling: Sampling
    warming_c: float
    warming_part: float
    """Time constant of the warming, as a part of the recording."""

    def measure(self, run: _Run, effects: list[Effect]) -> tuple[Motion, Recording]:
        rng = np.random.default_rng(run.seed)
        scene = Scene(self.rig.believed(), run.start, Sensor(full_scale_g=self.rig.full_scale_g))
        for effect in effects:
            scene = effect.apply(scene, rng)
        motion = simulate(scene.mechanics, scene.start, run.duration_s + MARGIN_S)
        if scene.sensor.lag is not None:
            motion = after_its_past(motion, scene)
        temperature = Temperature(22.0, self.warming_c, self.warming_part * run.duration_s)
        count = round(run.duration_s * self.rig.rate_hz)
        return motion, record(motion, scene.sensor, self.sampling, temperature, count, rng)


def after_its_past(motion: Motion, scene: Scene) -> Motion:
    """With what a low-pass has seen before: a free swing backwards in time is a swing with its rates turned round."""
    free = Mechanics(scene.mechanics.length_m, scene.mechanics.position_m, scene.mechanics.gravity_m_s2)
    x, y = scene.start.tilt_rate_rad_s
    past = simulate(
        replace(free, spin_rad_s=-scene.mechanics.spin_rad_s), replace(scene.start, tilt_rate_rad_s=(-x, -y)), SETTLE_S
    )
    return Motion(
        np.concatenate([-past.time_s[:0:-1], motion.time_s]),
        np.concatenate([past.force_m_s2[:0:-1], motion.force_m_s2]),
        np.concatenate([past.angle_rad[:0:-1], motion.angle_rad]),
    )


def _draw_effects(
    rng: np.random.Generator, plan: Plan, world: _World, log: _Run, believed: BelievedMotion
) -> tuple[list[Effect], dict[str, float]]:
    """The effects, each drawn until it shows by itself on the log, and its excess there; fewer where one does not show."""
    effects, alone = [], {}
    for name in plan.hidden:
        for _ in range(DRAWS):
            effect = {**CATALOGUE, **OUTSIDE, **LAW_EFFECTS}[name](rng, world.rig, SMALL if plan.small else USUAL)
            alone[name] = believed.excess(world.measure(log, [effect])[1])
            if alone[name] >= VISIBLE:
                effects.append(effect)
                break
    return effects, alone


def draw_start(rng: np.random.Generator, rig: Rig) -> Start:
    """An elliptical swing of the rig's amplitude or down to 0.7 of it, at any phase, in any direction."""
    major = rig.amplitude_rad * rng.uniform(0.7, 1.0)
    minor = major * rng.uniform(-0.6, 0.6)
    phase, turn = rng.uniform(0, 2 * np.pi), np.exp(1j * rng.uniform(0, 2 * np.pi))
    place = turn * (major * np.cos(phase) + 1j * minor * np.sin(phase))
    rate = turn * rig.rate_rad_s * (1j * minor * np.cos(phase) - major * np.sin(phase))
    heading_rad = float(rng.uniform(0, 2 * np.pi))
    return Start((float(place.real), float(place.imag)), (float(rate.real), float(rate.imag)), heading_rad)


def _draw_rig(rng: np.random.Generator) -> Rig:
    length_m = round(float(rng.uniform(5.5, 25.0)), 4)
    return Rig(
        length_m=length_m,
        position_m=round(length_m * float(rng.uniform(0.17, 0.85)), 4),
        noise_g=float(rng.choice([0.0003, 0.0008, 0.002])),
        amplitude_rad=float(np.radians(rng.uniform(5.0, 12.0))),
    )


def _draw_sampling(rng: np.random.Generator, rig: Rig, plan: Plan) -> Sampling:
    memory, jitter_s, stamp_s = rng.uniform(0.3, 0.95), rng.uniform(0.0005, 0.003), rng.uniform(0.0, 0.0005)
    return Sampling(
        rate_hz=rig.rate_hz,
        noise_g=rig.noise_g,
        noise_memory=float(memory) if plan.coloured else 0.0,
        jitter_s=float(jitter_s) if plan.jittered else 0.0,
        stamp_s=float(stamp_s) if plan.jittered else 0.0,
    )


def _facts(motion: Motion, run: _Run) -> dict[str, float]:
    during = (motion.time_s >= 0) & (motion.time_s <= run.duration_s)
    late = during & (motion.time_s >= run.duration_s * 2 / 3)
    return {
        "phi_max_deg": float(np.degrees(motion.angle_rad[during].max())),
        "phi_max_last_third_deg": float(np.degrees(motion.angle_rad[late].max())),
    }


def _truth(plan: Plan, world: _World, effects: list[Effect]) -> dict[str, Any]:
    """An outside effect may contain one of the catalogue."""
    true = {effect.name: effect.parameters for effect in effects}
    return {
        "seed": plan.seed,
        "kind": plan.kind,
        "effects": true | {ALSO_TRUE[name]: {} for name in true if name in ALSO_TRUE},
        "noise_memory": world.sampling.noise_memory,
        "jitter_s": world.sampling.jitter_s,
        "stamp_s": world.sampling.stamp_s,
        "small": plan.small,
    }
