"""What carries the pivot, in MuJoCo: a mass on a spring and a damper in each of two horizontal directions."""

import mujoco
import numpy as np

from tests.blind.mechanics import Start, Structure


def slides_xml(structure: Structure, weight_n: float) -> tuple[str, float]:
    """The joints, and the mass in kg on them that gives the structure its own frequency."""
    cos, sin = np.cos(structure.azimuth_rad), np.sin(structure.azimuth_rad)
    stiffness = [weight_n / each for each in structure.deflection_m]
    mass_kg = stiffness[0] / (2 * np.pi * structure.frequency_hz) ** 2
    slides = [
        f'<joint name="{name}" type="slide" axis="{axis}" stiffness="{each}" '
        f'damping="{2 * structure.damping_ratio * np.sqrt(each * mass_kg)}"/>'
        for name, axis, each in zip(("soft", "stiff"), (f"{cos} {sin} 0", f"{-sin} {cos} 0"), stiffness, strict=True)
    ]
    return "".join(slides), float(mass_kg)


def bend(model: mujoco.MjModel, data: mujoco.MjData, structure: Structure, start: Start) -> None:
    """Let the structure give way to the rope's pull from the beginning, so that its own mode hardly rings."""
    slope, rate = (np.array([*pair]) for pair in (start.tilt_rad, start.tilt_rate_rad_s))
    soft = np.array([np.cos(structure.azimuth_rad), np.sin(structure.azimuth_rad)])
    across = np.array([-soft[1], soft[0]])
    for name, axis, deflection_m in zip(("soft", "stiff"), (soft, across), structure.deflection_m, strict=True):
        joint = model.joint(name)
        data.qpos[joint.qposadr[0]] = deflection_m * float(axis @ slope)
        data.qvel[joint.dofadr[0]] = deflection_m * float(axis @ rate)
