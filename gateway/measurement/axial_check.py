"""Whether the smoothed motion of a free swing agrees with the force along the rope, whatever the place of the housing.

With X the complex amplitude of the rope's angle across the rope, z reads -(rho/2 + 1/4) X . X at twice the frequency, and x and y
read -(1 - rho) X: a wrong place changes the angle by x and y in proportion, and the one by z by a tenth.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from devices.pendulum.small_swing import small_swing_period_s
from gateway.measurement.source import Source
from gateway.motion.history import MotionHistory
from gateway.numerics.array import Array
from gateway.swing.data.bins import BINS_PER_PERIOD, bin_samples
from gateway.swing.data.input_checks import effective_noise_g
from gateway.swing.detection.dead_axis import (
    APART_SIGMA,
    MAX_NOISE_SHARE,
    MIN_ASYMMETRY,
    WINDOW_PERIODS,
)
from gateway.swing.fit.harmonics import Harmonics, refine_harmonics
from gateway.swing.rig import MountedHousing
from gateway.units import degrees

FEWEST_PERIODS = 1.2
"""Shortest free swing that is judged, in periods. Basis: a choice; three turning points."""
MAX_DRIVEN_SHARE = 0.4
"""Part of the motion that is no harmonic, up to which a swing is compared. Basis: with a wrong place, what is called free takes
in a part of a drive, 0.13 to 0.41; of 25 cranes with the right place none is doubted by it."""
STATED_SIGMA = 2.0
"""Standard uncertainties of the smoothed angle that are allowed for. Basis: a choice; what the interval of 95 % contains."""


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A free swing whose smoothed angle is not that by the force along the rope; amplitudes of the swing in rad."""

    from_s: float
    to_s: float
    stated_rad: float
    axial_rad: float

    def __str__(self) -> str:
        stated_deg, axial_deg = degrees(self.stated_rad), degrees(self.axial_rad)
        return (
            f"it contradicts the force along the rope: {stated_deg:.1f}° against {axial_deg:.1f}° at "
            f"{self.from_s:.0f}-{self.to_s:.0f} s; the housing is not where stated, or something else moved the load"
        )


def find_contradiction(source: Source, housing: MountedHousing, history: MotionHistory) -> Contradiction | None:
    """Return the largest swing of a recording whose smoothed angle the axial force contradicts; None where they agree.

    Only those swings count that the largest angle of the recording may be of.
    """
    largest = history.largest_angle()
    if largest is None or housing.possible_structures != ["rope"]:
        return None  # on a spreader, or one of several ropes, x and y belong to another swing than z
    low_rad = largest.coverage95_rad[0]
    found = [
        each for each in _contradictions(source, housing, history) if max(each.stated_rad, each.axial_rad) > low_rad
    ]
    return max(found, key=lambda each: max(each.stated_rad, each.axial_rad), default=None)


def _contradictions(source: Source, housing: MountedHousing, history: MotionHistory) -> Iterator[Contradiction]:
    time_s, noise_g = source.recording.time_s, effective_noise_g(source.force_g, source.noise_g)
    for phase in history.phases():
        part = history.between(phase.from_s, phase.to_s)
        period_s = small_swing_period_s(float(np.median(part.length_m)), housing.gravity_m_s2)
        periods = (phase.to_s - phase.from_s) / period_s
        if phase.state != "free" or periods < FEWEST_PERIODS:
            continue
        edges_s = np.linspace(phase.from_s, phase.to_s, max(1, int(periods / WINDOW_PERIODS)) + 1).tolist()
        for from_s, to_s in pairwise(edges_s):
            inside = (time_s >= from_s) & (time_s <= to_s)
            bins = bin_samples(time_s[inside], source.force_g[inside], period_s / BINS_PER_PERIOD)
            swing = part.between(from_s, to_s)
            if len(bins) < BINS_PER_PERIOD or not np.isfinite(swing.angle_rad).any():
                continue
            harmonics, length_m = refine_harmonics(bins, noise_g, housing)
            if (sizes := _compare(harmonics, housing.rho_at(length_m), swing)) is not None:
                yield Contradiction(from_s, to_s, *sizes)


def _compare(harmonics: Harmonics, rho: float, swing: MotionHistory) -> tuple[float, float] | None:
    """Return the amplitude by the smoothed motion and by the axial force where they do not belong together."""
    if harmonics.unexplained > MAX_DRIVEN_SHARE or harmonics.noise_share > MAX_NOISE_SHARE:
        return None
    axial_gain = rho / 2 + 0.25
    by_axial = -complex(harmonics.amplitude_g[2]) / axial_gain
    known = np.isfinite(swing.angle_rad)
    amplitude = _amplitude(swing, known, harmonics)
    stated = complex((amplitude**2).sum())
    largest, u_rad = max(abs(stated), abs(by_axial)), float(np.median(swing.u_rad[known]))
    allowed = STATED_SIGMA * 2 * float(np.linalg.norm(amplitude)) * u_rad + APART_SIGMA * harmonics.u_g[2] / axial_gain
    if abs(stated - by_axial) <= MIN_ASYMMETRY * largest + largest**2 / 2 + allowed:
        return None
    return math.sqrt(abs(stated)), math.sqrt(abs(by_axial))


def _amplitude(swing: MotionHistory, known: Array, harmonics: Harmonics) -> Array:
    """Return the complex amplitudes of the smoothed angle in x and y, rad, at the frequency and time of the harmonics."""
    phase_rad = 2 * math.pi * harmonics.frequency_hz * (swing.time_s[known] - harmonics.middle_s)
    basis = np.column_stack([np.ones_like(phase_rad), np.cos(phase_rad), np.sin(phase_rad)])
    angle_rad, azimuth_rad = swing.angle_rad[known], swing.azimuth_rad[known]
    across = angle_rad[:, None] * np.column_stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    _, cosine, sine = np.linalg.lstsq(basis, across, rcond=None)[0]
    amplitude: Array = cosine - 1j * sine
    return amplitude
