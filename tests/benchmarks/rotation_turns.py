"""Simulated turns on a rig: a sensor of known errors, mounted and levelled as a person would, with the rig's own errors."""

from dataclasses import dataclass

import numpy as np

from gateway.bench.rotation_turn import TurnReadings
from gateway.numerics.array import Array

SINE_COSINE = {1: (0, 2), 0: (1, 2)}


@dataclass(frozen=True)
class Rig:
    """Standard deviations of what a rig and a person do wrong."""

    angles: int = 36
    mounting_deg: float = 0.1
    level_deg: float = 0.2
    angle_deg: float = 0.02
    noise_g: float = 5e-5


def draw_sensor(random: np.random.Generator) -> tuple[Array, Array]:
    """Return sensitivity (3, 3) and offset (3,): scale and cross-axis errors of 2 %, offsets of 30 mg."""
    return np.eye(3) + 0.02 * random.standard_normal((3, 3)), 0.03 * random.standard_normal(3)


def turn(random: np.random.Generator, sensor: tuple[Array, Array], rotation_axis: int, rig: Rig) -> TurnReadings:
    """Return a turn about x (0) or y (1) with the reading of the rig as angle."""
    sensitivity, offset = sensor
    nominal = np.arange(rig.angles) * 2 * np.pi / rig.angles
    angle = nominal + np.radians(rig.angle_deg) * random.standard_normal(rig.angles)
    level = np.radians(rig.level_deg) * random.standard_normal()
    sine_axis, cosine_axis = SINE_COSINE[rotation_axis]
    up = np.zeros((rig.angles, 3))
    up[:, sine_axis], up[:, cosine_axis] = np.cos(level) * np.sin(angle), np.cos(level) * np.cos(angle)
    up[:, rotation_axis] = np.sin(level)
    up = up @ rotation_matrix(np.radians(rig.mounting_deg) * random.standard_normal(3)).T
    mean = offset + up @ sensitivity.T + rig.noise_g * random.standard_normal((rig.angles, 3))
    return TurnReadings("turn.csv", nominal, mean, np.ones(rig.angles), None, None)


def rotation_matrix(vector_rad: Array) -> Array:
    """Return the matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(vector_rad))
    x, y, z = vector_rad / angle if angle else np.zeros(3)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew)
