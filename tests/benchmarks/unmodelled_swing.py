"""How far an angle is wrong where something swings or yields that the fit of a pendulum does not know, over the misfit it leaves.

    python -m tests.benchmarks.unmodelled_swing [CASES] [SEED]

Links by MuJoCo, with a second link below, on a stand that yields, or both; length by the period, place wrong by up to 5 %, an
uncalibrated sensor.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from gateway.pipeline.rig import UNCALIBRATED, Rig
from gateway.swing.detection.rope_length import rope_length_by_period
from gateway.swing.offline import estimate_swing
from gateway.swing.uncertainty.uncertainty_model import SMALL_MISFIT
from tests.blind.rigid_pendulum import GRAVITY_M_S2

CASES, SEED = 27, 4
KINDS = ("link", "stand", "both")


@dataclass(frozen=True)
class Found:
    """Relative error and half width of an answer, and the misfit of its last fit."""

    error: float
    half_width: float
    misfit: float


def ask(rng: np.random.Generator, kind: str) -> Found | None:
    """Return what is found of a drawn link; None without an interval."""
    line_m = rng.uniform(0.15, 0.6)
    centre_m, inertia = line_m * rng.uniform(0.45, 0.7), line_m**2 / 12 * rng.uniform(0.7, 1.3)
    about_pivot = inertia + centre_m**2
    equivalent_m = about_pivot / centre_m
    sensor_m, rate_1_s = equivalent_m * rng.uniform(0, 1.3), np.sqrt(GRAVITY_M_S2 * centre_m / about_pivot)
    second = ""
    if kind != "stand":
        mass, second_m = float(np.exp(rng.uniform(np.log(0.003), np.log(0.06)))), line_m * rng.uniform(0.2, 1.0)
        across = mass * second_m**2 / 12
        second = f"""<body pos="0 0 {-line_m}"><joint type="hinge" axis="0 1 0" damping="{10 ** rng.uniform(-5, -3.5)}"/>
          <inertial pos="0 0 {-second_m / 2}" mass="{mass}" diaginertia="{across} {across} 1e-6"/></body>"""
    stand = ""
    if kind != "link":
        mass, own_1_s = rng.uniform(2, 20), rate_1_s * rng.uniform(2, 8)
        damping = 2 * rng.uniform(0.01, 0.1) * mass * own_1_s
        stand = f"""<joint type="slide" axis="1 0 0" stiffness="{mass * own_1_s**2}" damping="{damping}"/>
          <inertial pos="0 0 0" mass="{mass}" diaginertia="1e-3 1e-3 1e-3"/>"""
    step_s = 2 * np.pi / rate_1_s / 600
    hinge = f'damping="{2 * 10 ** rng.uniform(-3, -1.9) * about_pivot * rate_1_s}"'
    friction = f'frictionloss="{rng.uniform(0, 0.004) * centre_m * GRAVITY_M_S2}"'
    link = f"""<body><joint name="pivot" type="hinge" axis="0 1 0" {hinge} {friction}/>
      <inertial pos="0 0 {-centre_m}" mass="1" diaginertia="{inertia} {inertia} 1e-4"/>
      <site name="sensor" pos="{rng.uniform(-0.02, 0.02)} 0 {-sensor_m}"/>{second}</body>"""
    option = f'<option timestep="{step_s}" gravity="0 0 {-GRAVITY_M_S2}" integrator="RK4"/>'
    world = f"<body>{stand}{link}</body>" if stand else link
    sensors = '<sensor><accelerometer site="sensor"/></sensor>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{world}</worldbody>{sensors}</mujoco>")
    data = mujoco.MjData(model)
    pivot = model.joint("pivot").qposadr[0]
    data.qpos[pivot] = np.radians(rng.uniform(12, 95))
    angle_rad, force_g = np.empty(int(rng.uniform(6000, 15000))), []
    for number in range(len(angle_rad)):
        angle_rad[number] = abs(data.qpos[pivot])
        mujoco.mj_step(model, data)
        force_g.append(data.sensordata / GRAVITY_M_S2)
    time_s = np.arange(0, step_s * (len(angle_rad) - 1), 1 / float(rng.choice([50, 100, 200])))
    at_s = step_s * np.arange(len(angle_rad))
    readings_g = np.stack([np.interp(time_s, at_s, axis) for axis in np.array(force_g).T], axis=1)
    readings_g = readings_g * (1 + rng.normal(0, 0.01, 3)) + rng.normal(0, 0.02, 3)
    readings_g += 1e-3 * rng.uniform(0.3, 3) * rng.normal(size=readings_g.shape)
    return _answer(time_s, readings_g, sensor_m * rng.uniform(0.95, 1.05), float(angle_rad[at_s <= time_s[-1]].max()))


def _answer(time_s: np.ndarray, readings_g: np.ndarray, sensor_m: float, true_rad: float) -> Found | None:
    by_period = rope_length_by_period(time_s, readings_g, GRAVITY_M_S2)
    if by_period is None or sensor_m > 1.5 * by_period.length_m:
        return None
    housing = {"position_m": sensor_m, "position_u_m": 0.05 * by_period.length_m}
    rig = Rig.model_validate({"rope": {"length_m": by_period.length_m, "length_u_rel": 0.07}, "housing": housing})
    estimate = estimate_swing(time_s, readings_g, rig=rig.mounted_housing(UNCALIBRATED))
    wider = [reason for reason in estimate.reasons if reason.startswith("wider interval") and "unexplained" in reason]
    if (
        estimate.coverage95_rad is None
        or estimate.phi_max_rad is None
        or not wider
        or "fitted in" in estimate.reasons[0]
    ):
        return None
    low_rad, high_rad = estimate.coverage95_rad
    return Found(
        abs(estimate.phi_max_rad / true_rad - 1),
        (high_rad - low_rad) / 2 / true_rad,
        float(wider[0].split()[2].rstrip("%")) / 100,
    )


def drawn(cases: int, seed: int) -> Iterator[Found]:
    """Yield the answers that one fit of the whole recording gives with a misfit that is not small."""
    rng = np.random.default_rng(seed)
    for number in range(cases):
        found = ask(rng, KINDS[number % len(KINDS)])
        if found is not None and found.misfit > SMALL_MISFIT:
            yield found


def main(cases: int = CASES, seed: int = SEED) -> None:
    """Print the quantiles of error over misfit, and how many intervals hold."""
    found = list(drawn(cases, seed))
    ratio = np.array([each.error / each.misfit for each in found])
    print(
        f"{len(found)} of {cases} with a misfit above {SMALL_MISFIT:.1%}; error over misfit, quantiles 0.5, 0.9, 0.95, 1:"
    )
    print(np.quantile(ratio, [0.5, 0.9, 0.95, 1]).round(2))
    print(f"interval right: {np.mean([each.error <= each.half_width for each in found]):.0%}")
    print(f"half width, median: {np.median([each.half_width for each in found]):.1%}")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
